//! What a log has in it when the run does not end as it should.
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

/// A number below `n` (SplitMix64, Steele, Lea and Flood 2014).
fn below(seed: u64, n: u64) -> u64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) % n
}

/// A run on a device in real time, killed some time after its first sample. Gives how many samples were recovered.
fn killed(trial: u64) -> usize {
    let lab = Lab::new();
    lab.ok("excite sine --rate 1000 --high 80 --frequency 0.25 --cycles 3 -o u.csv");
    let device = Served::for_one_host(PLANT, RATE_HZ);
    let mut running = lab.command(&format!("run --daq {} --drive u.csv --log cut.mcap", device.daq()));
    let mut running = running.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !lab.path("cut.mcap").exists() {
        assert!(running.try_wait().unwrap().is_none(), "it ends before there is a sample");
        sleep(Duration::from_millis(1));
    }
    sleep(Duration::from_millis(below(trial, 3000)));
    signal("KILL", running.id());
    running.wait().unwrap();
    // More than the host has heard of: what was on its way to it is lost as well.
    let measured = device.when_left().measured as usize;

    assert!(parsed(&lab, "cut.mcap").lost.cut_off, "it was killed too late");
    lab.ok("log recover cut.mcap -o whole.mcap");
    let log = parsed(&lab, "whole.mcap");
    assert!(!log.lost.cut_off);
    let samples = log.samples.len();
    assert!(measured - samples <= RATE_HZ as usize, "trial {trial}: {samples} of {measured} samples are left");
    // From the first one on, none left out.
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
fn a_run_that_is_killed_leaves_all_but_the_last_second() {
    hystctl();
    // A few at a time: each of them waits most of the time.
    let recovered: Vec<usize> = std::thread::scope(|scope| {
        let trials = |first| (first..TRIALS).step_by(4).map(killed).collect::<Vec<_>>();
        let running: Vec<_> = (0..4).map(|first| scope.spawn(move || trials(first))).collect();
        running.into_iter().flat_map(|trials| trials.join().unwrap()).collect()
    });
    println!("samples recovered: {recovered:?}");
    assert_eq!(recovered.len(), TRIALS as usize);
    assert!(recovered.iter().filter(|samples| **samples > 500).count() > TRIALS as usize / 2, "{recovered:?}");
}

/// `hystctl` where a file may have at most so many blocks of 512 bytes.
fn limited(lab: &Lab, blocks: usize, line: &str) -> Ran {
    // The signal that would end it is ignored: it is told as it is told that a disk is full.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh"]).arg(hystctl()).args(line.split(' '));
    command.current_dir(lab.path("")).output().unwrap().into()
}

/// What has to be said of a log that could not be written to its end.
fn told(ran: &Ran, log: &RunLog, because: &str) {
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    for part in ["run.mcap: the log cannot be continued", because, "free space", "log recover run.mcap"] {
        assert!(ran.stderr.contains(part), "\"{part}\" is missing in: {}", ran.stderr);
    }
    let safe = ran.stderr.split("at least the first ").nth(1).and_then(|rest| rest.split(' ').next());
    let safe: usize = safe.and_then(|count| count.parse().ok()).unwrap_or_else(|| panic!("no number: {}", ran.stderr));
    // Half a second is on its way to the disk at most; of a chunk that is there in part its samples are read.
    assert!(safe > 0 && (safe..=safe + 252).contains(&log.samples.len()), "{safe} of {}", log.samples.len());
}

#[test]
fn a_log_that_cannot_grow_ends_the_run_at_rest() {
    let lab = Lab::new();
    lab.write("plant.toml", PLANT);
    lab.excite("u.csv", 1);
    let run = "run --daq sim:plant.toml --drive u.csv --log run.mcap";
    let ran = limited(&lab, 40, run);
    let log = parsed(&lab, "run.mcap");
    told(&ran, &log, "File too large");
    assert!(ran.stderr.contains("the device was brought to rest"), "{}", ran.stderr);
    assert!(log.lost.cut_off && log.samples.len() > 100, "{}", log.samples.len());
    lab.ok("log recover run.mcap -o whole.mcap");
    assert_eq!(parsed(&lab, "whole.mcap").samples, log.samples);
    // That there is no room for the record either does not hide what has ended the run.
    let ran = limited(&lab, 16, "run --daq sim:plant.toml --drive u.csv --log small.mcap --record small.csv");
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(ran.stderr.contains("error: small.mcap: the log cannot be continued"), "{}", ran.stderr);
    assert!(ran.stderr.contains("could not be saved: small.csv") && !lab.path("small.csv").exists(), "{}", ran.stderr);
    // All of it, as a run without limits has it.
    let ran = lab.ok(&format!("{run} --record u-record.csv"));
    assert!(ran.stderr.contains("run.mcap.~1~"), "{}", ran.stderr);
    let all = parsed(&lab, "run.mcap");
    assert_eq!(all.samples[..log.samples.len()], log.samples);

    // There is room for the samples, but none for what stands behind them: the record is written all the same.
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

    // Nothing moves where not even its beginning can be written.
    fs::remove_file(lab.path("run.mcap")).unwrap();
    let ran = limited(&lab, 0, run);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("run.mcap: the log cannot be written: File too large"), "{}", ran.stderr);
    assert!(!lab.path("run.mcap").exists());
}

/// A disk of 32 KiB, where this computer lets its users have one.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_ends_the_run_at_rest() {
    let lab = Lab::new();
    lab.write("plant.toml", PLANT);
    lab.excite("u.csv", 1);
    let own = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--mount", "--map-root-user", "sh", "-c", script, "sh"]).arg(hystctl());
        command.current_dir(lab.path("")).output().map(Ran::from)
    };
    fs::create_dir(lab.path("disk")).unwrap();
    let mount = "mount -t tmpfs -o size=32k none disk";
    if own(mount).map_or(-1, |ran| ran.code) != 0 {
        println!("skipped: nobody but root may have a disk of its own here; `unshare --mount --map-root-user {mount}`");
        return;
    }
    let run = "\"$1\" run --daq sim:../plant.toml --drive ../u.csv --log run.mcap";
    let ran = own(&format!("{mount} && cd disk && {run}; code=$?; cp run.mcap ../full.mcap; exit $code")).unwrap();
    let log = parsed(&lab, "full.mcap");
    told(&ran, &log, "No space left on device");
    assert!(log.lost.cut_off && log.samples.len() > 100, "{}", log.samples.len());
    lab.ok("log recover full.mcap -o whole.mcap");
    assert_eq!(parsed(&lab, "whole.mcap").samples, log.samples);
}

#[test]
fn a_log_says_what_wrote_it() {
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
