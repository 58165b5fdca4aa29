//! Faulty connections and devices: each is reported with advice.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::thread;

use hyst_hw::Serial;
use hyst_hw::wire::{Deframer, MAX_FRAME, Reply, Request, Tell, encode};
use hyst_tests::{Lab, Ran};

/// Returns a folder with a drive.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.ok("excite sine --rate 500 --high 10 --frequency 5 --cycles 2 -o u.csv");
    lab
}

/// Opens a pair of pseudo terminals. Returns the pair and the path of the second one.
#[cfg(unix)]
fn terminal() -> (Box<dyn std::any::Any>, String) {
    use serialport::SerialPort;
    let (first, second) = serialport::TTYPort::pair().unwrap();
    let path = second.name().unwrap();
    (Box::new((first, second)), path)
}

#[cfg(unix)]
#[test]
fn a_port_in_use_is_reported_as_busy() {
    let lab = lab();
    let (_held, path) = terminal();
    // The pair has opened it already; opening it once more locks it in any case.
    let _locked = Serial::open(&path, 115_200);
    let message = lab.fails(&format!("run --daq serial:{path} --drive u.csv --record y.csv"), 3);
    assert!(message.contains(&path) && message.contains("another program uses the port"), "{message}");
}

#[cfg(unix)]
#[test]
#[cfg_attr(not(other_user), ignore = "other users may not run programs of the target folder")]
fn a_port_without_permission_is_reported_with_the_group() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let lab = lab();
    let (_held, path) = terminal();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    fs::set_permissions(lab.path(""), fs::Permissions::from_mode(0o777)).unwrap();
    let line = format!("run --daq serial:{path} --drive u.csv --record y.csv");
    // Permissions do not apply to root: run as another user.
    let root = fs::metadata(lab.path("u.csv")).unwrap().uid() == 0;
    let direct = lab.command(&line);
    let mut command = if root {
        let mut other = Command::new("setpriv");
        other.args(["--reuid=65534", "--regid=65534", "--clear-groups"]);
        other.arg(direct.get_program()).args(direct.get_args()).current_dir(lab.path(""));
        other
    } else {
        direct
    };
    let ran = Ran::from(command.output().unwrap());
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains("permission denied") && ran.stderr.contains("dialout"), "{ran:?}");
}

/// Starts a server that handles received bytes with `answer`. Returns its address.
fn server(mut answer: impl FnMut(&mut TcpStream, &[u8]) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = [0; 1024];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            answer(&mut stream, &bytes[..count]);
        }
    });
    format!("tcp:{address}")
}

#[test]
fn another_device_and_a_silent_device_have_different_messages() {
    let lab = lab();
    let modem = server(|stream, _| {
        let _ = stream.write_all(b"ERROR\r\n\0");
    });
    let message = lab.fails(&format!("run --daq {modem} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("other data arrives there") && message.contains("check the port"), "{message}");
    let silent = server(|_, _| {});
    let message = lab.fails(&format!("run --daq {silent} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("no answer within 2 s") && message.contains("powered"), "{message}");
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let message = lab.fails(&format!("run --daq tcp:{closed} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("no connection"), "{message}");
}

#[test]
fn a_device_of_another_version_is_reported_with_both_versions() {
    let lab = lab();
    let mut deframer = Deframer::new();
    let other = server(move |stream, bytes| {
        let mut fresh = bytes;
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = Reply { number: request.number, tell: Tell::Version(99) };
            let _ = stream.write_all(encode(&reply, &mut [0; MAX_FRAME]).unwrap());
        }
    });
    let message = lab.fails(&format!("run --daq {other} --drive u.csv --record y.csv"), 2);
    assert!(message.contains("version 99") && message.contains("update the older one"), "{message}");
}

#[test]
fn a_reference_beyond_the_limits_is_reported() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 2.0, 14.0);
    let ran = lab.ok("run --daq sim:plant.toml --model model.json --reference r.csv --limit 0,40 --log run.mcap");
    let text = format!("{}{}", ran.stdout, ran.stderr);
    assert!(text.contains("limit"), "{text}");
    println!("{text}");
    // Limits beyond those of the device are rejected.
    let message = lab.fails("run --daq sim:plant.toml --model model.json --reference r.csv --limit 0,400", 2);
    assert!(message.contains("0 to 100 V"), "{message}");
}
