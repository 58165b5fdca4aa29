//! Lines and devices with something wrong: each is told, with what to do.

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::thread;

use hyst_hw::Serial;
use hyst_hw::wire::{Deframer, MAX_FRAME, Reply, Request, Tell, encode};
use hyst_tests::{Lab, Ran};

/// A folder with a drive to play.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.ok("excite sine --rate 500 --high 10 --frequency 5 --cycles 2 -o u.csv");
    lab
}

/// A pair of pseudo terminals: one is kept, the path leads to the other.
#[cfg(unix)]
fn terminal() -> (Box<dyn std::any::Any>, String) {
    use serialport::SerialPort;
    let (kept, other) = serialport::TTYPort::pair().unwrap();
    let path = other.name().unwrap();
    (Box::new((kept, other)), path)
}

#[cfg(unix)]
#[test]
fn a_port_that_another_program_holds_is_busy() {
    let lab = lab();
    let (_held, path) = terminal();
    // The pair holds it already; opened once more it is locked for sure.
    let _locked = Serial::open(&path, 115_200);
    let message = lab.refuses(&format!("run --daq serial:{path} --drive u.csv --record y.csv"), 3);
    assert!(message.contains(&path) && message.contains("another program uses the port"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_port_that_one_may_not_open_is_told_with_the_group() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let lab = lab();
    let (_held, path) = terminal();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    fs::set_permissions(lab.path(""), fs::Permissions::from_mode(0o777)).unwrap();
    let line = format!("run --daq serial:{path} --drive u.csv --record y.csv");
    // Whoever may do everything has to be somebody else for it.
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
    let Ok(output) = command.output() else {
        println!("skipped: there is no setpriv to become a user who may not");
        return;
    };
    let ran = Ran::from(output);
    if ran.stderr.starts_with("setpriv: failed to execute") {
        println!("skipped: hystctl lies where other users may not run it");
        return;
    }
    assert_eq!(ran.code, 3, "{ran:?}");
    assert!(ran.stderr.contains("permission denied") && ran.stderr.contains("dialout"), "{ran:?}");
}

/// Somebody at a socket who answers in his own way; gives the address.
fn somebody(mut answers: impl FnMut(&mut TcpStream, &[u8]) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = [0; 1024];
        while let Ok(count @ 1..) = stream.read(&mut bytes) {
            answers(&mut stream, &bytes[..count]);
        }
    });
    format!("tcp:{address}")
}

#[test]
fn another_device_is_told_from_one_that_is_silent() {
    let lab = lab();
    let modem = somebody(|stream, _| {
        let _ = stream.write_all(b"ERROR\r\n\0");
    });
    let message = lab.refuses(&format!("run --daq {modem} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("other data arrives there") && message.contains("check the port"), "{message}");
    let silent = somebody(|_, _| {});
    let message = lab.refuses(&format!("run --daq {silent} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("no answer within 2 s") && message.contains("powered"), "{message}");
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let message = lab.refuses(&format!("run --daq tcp:{nobody} --drive u.csv --record y.csv"), 3);
    assert!(message.contains("no connection"), "{message}");
}

#[test]
fn a_device_of_another_version_is_told_with_both() {
    let lab = lab();
    let mut deframer = Deframer::new();
    let other = somebody(move |stream, bytes| {
        let mut fresh = bytes;
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = Reply { number: request.number, tell: Tell::Version(99) };
            let _ = stream.write_all(encode(&reply, &mut [0; MAX_FRAME]).unwrap());
        }
    });
    let message = lab.refuses(&format!("run --daq {other} --drive u.csv --record y.csv"), 2);
    assert!(message.contains("version 99") && message.contains("update the older one"), "{message}");
}

#[test]
fn a_reference_beyond_the_limits_is_told_with_how_far() {
    let lab = Lab::with_model();
    lab.reference("r.csv", 2.0, 14.0);
    let ran = lab.ok("run --daq sim:plant.toml --model model.json --reference r.csv --limit 0,40 --log run.mcap");
    let said = format!("{}{}", ran.stdout, ran.stderr);
    assert!(said.contains("limit"), "{said}");
    println!("{said}");
    // Limits beyond the device's own are refused, and a device that cannot keep a slew is not started.
    let message = lab.refuses("run --daq sim:plant.toml --model model.json --reference r.csv --limit 0,400", 2);
    assert!(message.contains("0 to 100 V"), "{message}");
}
