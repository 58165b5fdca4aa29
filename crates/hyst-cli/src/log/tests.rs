//! A log during a run, after a crash and beside an older one.

use super::*;
use hyst_hw::Phase;
use hyst_ident::record::{ColumnMap, Need, OutputUnit, Record};

fn info() -> RunInfo<'static> {
    RunInfo { device: "test", output: OutputUnit::Micrometre, sample_rate_hz: 100.0, model: None }
}

fn sample(k: u32) -> LoggedSample {
    sample_of(Phase::Record, k)
}

fn sample_of(phase: Phase, k: u32) -> LoggedSample {
    let time_s = f64::from(k) * 0.01;
    let measured =
        hyst_hw::Sample { time_s, drive_v: 1.0, output: 2.5, temperature_degc: None, load_n: None, force_n: None };
    LoggedSample::new(0, phase, &measured, Some(2.0))
}

fn read(path: &Path) -> Vec<serde_json::Value> {
    let bytes = std::fs::read(path).unwrap();
    let messages = mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into()).unwrap();
    // A crash loses the incomplete part at the end.
    messages.map_while(Result::ok).map(|message| serde_json::from_slice(&message.data).unwrap()).collect()
}

#[test]
fn a_closed_log_holds_all_samples() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RunLog::create(&path, &info()).unwrap();
    (0..250).for_each(|k| log.sample(&sample(k)).unwrap());
    assert_eq!(log.samples(), 250);
    log.finish().unwrap();
    let read = read(&path);
    assert_eq!(read.len(), 250);
    assert_eq!(read[2]["error"], 0.5);
    assert_eq!(read[2]["phase"], "record");
    assert!(read[2].get("load_n").is_none());
    let summary = mcap::Summary::read(&std::fs::read(&path).unwrap()).unwrap().unwrap();
    assert_eq!(summary.stats.unwrap().message_count, 250);
    assert!(summary.chunk_indexes.len() >= 2);
}

#[test]
fn all_but_the_last_half_second_is_in_the_file_during_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RunLog::create(&path, &info()).unwrap();
    (0..250).for_each(|k| log.sample(&sample(k)).unwrap());
    assert!(read(&path).len() >= 202);
    drop(log);
}

#[test]
fn a_last_sample_is_written_within_half_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RunLog::create(&path, &info()).unwrap();
    for (k, all) in [(0, 1), (1, 2), (2, 3)] {
        log.sample(&sample(k)).unwrap();
        // Half a second is enough; the limit of a minute is for a busy machine.
        let began = std::time::Instant::now();
        while read(&path).len() < all && began.elapsed().as_secs() < 60 {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert_eq!(read(&path).len(), all);
        assert_eq!(log.sink.saved(), all as u32);
    }
    log.finish().unwrap();
    assert_eq!(read(&path).len(), 3);
}

#[test]
fn a_log_without_a_sample_in_its_file_describes_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RunLog::create(&path, &info()).unwrap();
    log.sample(&sample(0)).unwrap();
    let begun = hyst_ident::record::RunLog::parse("run.mcap", &std::fs::read(&path).unwrap()).unwrap();
    assert_eq!((begun.samples.len(), begun.lost.cut_off), (0, true));
    assert_eq!(begun.metadata["device"], "test");
}

#[test]
fn a_log_with_only_ramp_samples_is_refused_as_a_record() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut log = RunLog::create(&path, &info()).unwrap();
    (0..9).for_each(|k| log.sample(&sample_of(Phase::Approach, k)).unwrap());
    log.finish().unwrap();
    let refused = || Record::read(&path, &ColumnMap::default(), Need::InputAndOutput).unwrap_err().to_string();
    assert!(refused().contains("all 9 samples belong to the ramps"), "{}", refused());
}

#[test]
fn an_existing_log_is_renamed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "older").unwrap();
    let mut log = RunLog::beside_older(&path, &info()).unwrap();
    assert_eq!(log.older(), None);
    log.sample(&sample(0)).unwrap();
    assert_eq!(std::fs::read(log.older().unwrap()).unwrap(), b"older");
    #[cfg(unix)]
    assert!(RunLog::beside_older(&path, &info()).err().unwrap().to_string().contains("another run is writing this"));
    log.finish().unwrap();
    RunLog::beside_older(&path, &info()).unwrap();
    assert_eq!(read(&path).len(), 1);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_and_two_runs_cannot_write_one_log() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.mcap");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    assert!(RunLog::beside_older(&pipe, &info()).err().unwrap().to_string().contains("not a regular file"));
    // Both logs are opened before the first sample.
    let path = folder.path().join("run.mcap");
    let mut first = RunLog::beside_older(&path, &info()).unwrap();
    let mut second = RunLog::beside_older(&path, &info()).unwrap();
    first.sample(&sample(0)).unwrap();
    assert!(second.sample(&sample(0)).unwrap_err().to_string().contains("another run is writing this"));
    first.finish().unwrap();
    assert_eq!(read(&path).len(), 1);
}

#[test]
fn a_log_without_samples_does_not_replace_an_existing_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "older").unwrap();
    drop(RunLog::create(&path, &info()).unwrap());
    assert_eq!(std::fs::read(&path).unwrap(), b"older");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    RunLog::create(&folder.path().join("absent").join("run.mcap"), &info()).err().unwrap();
}
