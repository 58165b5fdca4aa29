//! The content of a log if the run is killed or the log cannot be written.
#![cfg(unix)]

use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use hyst_ident::record::RunLog;
use hyst_tests::logs::signal;
use hyst_tests::served::Served;
use hyst_tests::{Lab, PLANT, Ran, column, hystctl};

const RATE_HZ: f64 = 1000.0;
const TRIALS: u64 = 20;

fn parsed(lab: &Lab, name: &str) -> RunLog {
    RunLog::parse(name, &fs::read(lab.path(name)).unwrap()).unwrap()
}

/// Returns a random number below `n` (SplitMix64, Steele, Lea and Flood 2014).
fn below(seed: u64, n: u64) -> u64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) % n
}

/// Kills a run on a device in real time some time after its first sample. Returns the number of recovered samples.
fn samples_of_killed_run(trial: u64) -> usize {
    let lab = Lab::new();
    lab.ok("excite sine --rate 1000 --high 80 --frequency 0.25 --cycles 3 -o u.csv");
    let device = Served::for_one_host(PLANT, RATE_HZ);
    let mut running = lab.command(&format!("run --daq {} --drive u.csv --log cut.mcap", device.daq()));
    let mut running = running.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !lab.path("cut.mcap").exists() {
        assert!(running.try_wait().unwrap().is_none(), "the run ends before its first sample");
        sleep(Duration::from_millis(1));
    }
    sleep(Duration::from_millis(below(trial, 3000)));
    signal("KILL", running.id());
    running.wait().unwrap();
    // The device has measured more than the host has received.
    let measured = device.last_status().measured as usize;

    assert!(parsed(&lab, "cut.mcap").lost.cut_off, "the run was killed too late");
    lab.ok("log recover cut.mcap -o whole.mcap");
    let log = parsed(&lab, "whole.mcap");
    assert!(!log.lost.cut_off);
    let samples = log.samples.len();
    assert!(measured - samples <= RATE_HZ as usize, "trial {trial}: {samples} of {measured} samples recovered");
    // From the first sample, without a gap.
    let numbers = fs::read(lab.path("whole.mcap")).unwrap();
    let numbers = mcap::MessageStream::new(&numbers).unwrap().map(|message| message.unwrap().sequence);
    assert!(numbers.eq(0..samples as u32));
    assert!(log.samples.windows(2).all(|w| w[1].time_s > w[0].time_s));
    let drive = column(&lab.read("u.csv"), "voltage_v");
    let played = log.samples.iter().filter(|s| s.is_record()).map(|s| s.drive_v);
    assert!(played.zip(&drive).all(|(played, volts)| played == f64::from(*volts as f32)));
    samples
}

#[test]
fn a_killed_run_loses_at_most_the_last_second() {
    hystctl();
    // Four in parallel: each of them mostly waits.
    let recovered: Vec<usize> = std::thread::scope(|scope| {
        let trials = |first| (first..TRIALS).step_by(4).map(samples_of_killed_run).collect::<Vec<_>>();
        let running: Vec<_> = (0..4).map(|first| scope.spawn(move || trials(first))).collect();
        running.into_iter().flat_map(|trials| trials.join().unwrap()).collect()
    });
    println!("samples recovered: {recovered:?}");
    assert_eq!(recovered.len(), TRIALS as usize);
    assert!(recovered.iter().filter(|samples| **samples > 500).count() > TRIALS as usize / 2, "{recovered:?}");
}

/// Runs `hystctl` with a limit of the file size in blocks of 512 bytes.
fn limited(lab: &Lab, blocks: usize, line: &str) -> Ran {
    // The signal XFSZ is ignored: the program then gets a write error, as from a full disk.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh"]).arg(hystctl()).args(line.split(' '));
    command.current_dir(lab.path("")).output().unwrap().into()
}

/// Asserts the message about a log that could not be written to its end.
fn assert_log_error(ran: &Ran, log: &RunLog, because: &str) {
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    for part in ["run.mcap: the log cannot be continued", because, "free space", "log recover run.mcap"] {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    let safe = ran.stderr.split("at least the first ").nth(1).and_then(|rest| rest.split(' ').next());
    let safe: usize = safe.and_then(|count| count.parse().ok()).unwrap_or_else(|| panic!("no number: {}", ran.stderr));
    // At most half a second is not yet on the disk. The samples of an incomplete chunk are read.
    assert!(safe > 0 && (safe..=safe + 252).contains(&log.samples.len()), "{safe} of {}", log.samples.len());
}

#[test]
fn a_log_that_cannot_grow_stops_the_run_at_rest() {
    let lab = Lab::new();
    lab.write("plant.toml", PLANT);
    lab.excite("u.csv", 1);
    let run = "run --daq sim:plant.toml --drive u.csv --log run.mcap";
    let ran = limited(&lab, 40, run);
    let log = parsed(&lab, "run.mcap");
    assert_log_error(&ran, &log, "File too large");
    assert!(ran.stderr.contains("the device was ramped to rest ("), "{}", ran.stderr);
    assert!(log.lost.cut_off && log.samples.len() > 100, "{}", log.samples.len());
    lab.ok("log recover run.mcap -o whole.mcap");
    assert_eq!(parsed(&lab, "whole.mcap").samples, log.samples);
    // The error of the record does not hide the error that stopped the run.
    let ran = limited(&lab, 16, "run --daq sim:plant.toml --drive u.csv --log small.mcap --record small.csv");
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.stderr.contains("error: small.mcap: the log cannot be continued"), "{}", ran.stderr);
    assert!(ran.stderr.contains("could not be saved: small.csv") && !lab.path("small.csv").exists(), "{}", ran.stderr);
    // The complete log of a run without limits.
    let ran = lab.ok(&format!("{run} --record u-record.csv"));
    assert!(ran.stderr.contains("run.mcap.~1~"), "{}", ran.stderr);
    let all = parsed(&lab, "run.mcap");
    assert_eq!(all.samples[..log.samples.len()], log.samples);

    // There is room for the samples but not for the summary after them: the record is still written.
    let whole = fs::read(lab.path("run.mcap")).unwrap();
    let summary = mcap::Summary::read(&whole).unwrap().unwrap();
    let last = summary.chunk_indexes.iter().map(|c| c.chunk_start_offset + c.chunk_length).max().unwrap();
    fs::remove_file(lab.path("run.mcap")).unwrap();
    let room = (last as usize).div_ceil(512) + 1;
    assert!(512 * room < whole.len(), "{last} {}", whole.len());
    let ran = limited(&lab, 10_000.min(room), &format!("{run} --record late.csv"));
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.stderr.contains("run.mcap: the log cannot be continued"), "{}", ran.stderr);
    assert_eq!(parsed(&lab, "run.mcap").samples, all.samples);

    // If even the head of the log cannot be written, the run does not start.
    fs::remove_file(lab.path("run.mcap")).unwrap();
    let ran = limited(&lab, 0, run);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("run.mcap: the log cannot be written: File too large"), "{}", ran.stderr);
    assert!(!lab.path("run.mcap").exists());
}

/// Uses a disk of 32 KiB.
#[cfg(target_os = "linux")]
#[test]
#[cfg_attr(not(may_mount), ignore = "this user may not mount a disk: unshare --mount --map-root-user")]
fn a_full_disk_stops_the_run_at_rest() {
    let lab = Lab::new();
    lab.write("plant.toml", PLANT);
    lab.excite("u.csv", 1);
    let in_namespace = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--mount", "--map-root-user", "sh", "-c", script, "sh"]).arg(hystctl());
        command.current_dir(lab.path("")).output().map(Ran::from)
    };
    fs::create_dir(lab.path("disk")).unwrap();
    let mount = "mount -t tmpfs -o size=32k none disk";
    let run = "\"$1\" run --daq sim:../plant.toml --drive ../u.csv --log run.mcap";
    let ran =
        in_namespace(&format!("{mount} && cd disk && {run}; code=$?; cp run.mcap ../full.mcap; exit $code")).unwrap();
    let log = parsed(&lab, "full.mcap");
    assert_log_error(&ran, &log, "No space left on device");
    assert!(log.lost.cut_off && log.samples.len() > 100, "{}", log.samples.len());
    lab.ok("log recover full.mcap -o whole.mcap");
    assert_eq!(parsed(&lab, "whole.mcap").samples, log.samples);
}

#[test]
fn a_log_contains_the_version_of_the_program() {
    let lab = Lab::new();
    lab.write("plant.toml", PLANT);
    lab.ok("excite sine --rate 500 --high 60 --cycles 1 -o u.csv");
    lab.ok("run --daq sim:plant.toml --drive u.csv --log run.mcap");
    let metadata = parsed(&lab, "run.mcap").metadata;
    let version = lab.ok("--version").stdout;
    let git = Command::new("git").args(["describe", "--always", "--dirty"]).current_dir(hyst_tests::root()).output();
    match git.ok().filter(|git| git.status.success()) {
        Some(git) => {
            let now = String::from_utf8(git.stdout).unwrap().trim().trim_end_matches("-dirty").to_owned();
            assert!(metadata["git"].starts_with(&now), "{metadata:?} {now}");
            assert_eq!(version.trim(), format!("hystctl {} ({})", metadata["version"], metadata["git"]));
        }
        None => assert_eq!(version.trim(), format!("hystctl {}", metadata["version"])),
    }
}
