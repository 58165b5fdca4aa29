//! `run --live`: the data that a viewer receives over the WebSocket protocol of Foxglove.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::Stdio;

use hyst_tests::served::Served;
use hyst_tests::{Lab, PLANT};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, connect};

const RATE_HZ: f64 = 500.0;

#[test]
fn a_viewer_receives_the_samples_during_the_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 0.25 --cycles 2 -o u.csv"));
    let line = format!("run --daq {} --drive u.csv --log run.mcap --live 127.0.0.1:0 --silence 30", device.daq());
    let mut run = lab.command(&line).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut messages = BufReader::new(run.stderr.take().unwrap()).lines();
    let note = messages.find_map(|line| line.ok().filter(|line| line.contains("ws://"))).expect("the address");
    let mut request = note.split_whitespace().last().unwrap().into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "foxglove.sdk.v1".parse().unwrap());
    let (mut socket, _) = connect(request).unwrap();

    let (mut channels, mut samples) = (Vec::new(), Vec::new());
    while samples.len() < 300 {
        match socket.read().unwrap() {
            Message::Text(text) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                if message["op"] != "advertise" {
                    continue;
                }
                channels.extend(message["channels"].as_array().unwrap().iter().cloned());
                let sample = |channel: &&Value| channel["topic"] == "/actuator/sample";
                if let Some(channel) = channels.iter().find(sample) {
                    assert_eq!(
                        (&channel["encoding"], &channel["schemaEncoding"]),
                        (&json!("json"), &json!("jsonschema"))
                    );
                    let request =
                        json!({ "op": "subscribe", "subscriptions": [{ "id": 7, "channelId": channel["id"] }] });
                    socket.send(Message::text(request.to_string())).unwrap();
                }
            }
            Message::Binary(bytes) if bytes[0] == 1 => {
                assert_eq!(bytes[1..5], 7u32.to_le_bytes());
                let log_time = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
                samples.push((log_time, serde_json::from_slice::<Value>(&bytes[13..]).unwrap()));
            }
            _ => {}
        }
    }
    drop(socket);
    assert!(run.wait().unwrap().success());
    // 2 ms apart, in wall time, and equal to the log.
    for pair in samples.windows(2) {
        assert!((1_999_000..2_001_000).contains(&(pair[1].0 - pair[0].0)), "{pair:?}");
    }
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_nanos() as u64;
    assert!((now - 60_000_000_000..now).contains(&samples[0].0));
    let log = std::fs::read(lab.path("run.mcap")).unwrap();
    let logged: Vec<Value> = mcap::MessageStream::new(&log)
        .unwrap()
        .map(|message| serde_json::from_slice(&message.unwrap().data).unwrap())
        .collect();
    let first = logged.iter().position(|sample| *sample == samples[0].1).expect("the sample is in the log");
    assert!(samples.iter().zip(&logged[first..]).all(|((_, received), logged)| received == logged));
}

#[test]
fn an_address_in_use_is_reported_before_the_run() {
    let (lab, device) = (Lab::new(), Served::plant(PLANT, RATE_HZ));
    lab.ok(&format!("excite sine --rate {RATE_HZ} --high 80 --frequency 2 --cycles 1 -o u.csv"));
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    let message = lab.fails(&format!("run --daq {} --drive u.csv --record y.csv --live {address}", device.daq()), 1);
    assert!(message.contains(&address.to_string()) && message.contains("--live 127.0.0.1:8766"), "{message}");
    assert_eq!(device.put_out(), [0.0; 0]);
    assert!(lab.fails("run --daq sim:plant.toml --drive u.csv --live here", 2).contains("--live"));
}
