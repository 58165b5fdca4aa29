//! Runs the fuzz tests on all cores: `cargo run --release -p hyst-tests --example fuzz -- [CASES [FIRST_SEED]]`. One
//! case again: `… -- KIND SEED`; cases of one kind: `… -- KIND FIRST_SEED CASES`.

use std::error::Error;
use std::io::Write;
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hyst_tests::fuzz::{KINDS, Kind};

/// Interval at which the progress of a case is checked, and number of checks after which a case counts as endless.
const CHECK_INTERVAL: Duration = Duration::from_millis(20);
const MAX_CHECKS: u32 = 1000;
/// Failures of one kind after which the next kind starts.
const MAX_FAILURES: usize = 5;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(kind) = arguments.first().and_then(|name| Kind::named(name)) {
        let seed = arguments.get(1).ok_or("give the seed of the case")?.parse()?;
        if let Some(cases) = arguments.get(2) {
            return Ok(if of_kind(kind, seed, cases.parse()?) == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE });
        }
        kind.run(seed);
        println!("{} {seed}: nothing found", kind.name);
        return Ok(ExitCode::SUCCESS);
    }
    let number = |k: usize, default: u64| arguments.get(k).map_or(Ok(default), |text| text.parse());
    let (cases, first) = (number(0, 1_000_000)?, number(1, 0)?);
    let start = Instant::now();
    let mut found = 0;
    for kind in KINDS {
        found += of_kind(*kind, first, cases);
    }
    println!("{} kinds of {cases} cases in {:.0} s: {found} found", KINDS.len(), start.elapsed().as_secs_f64());
    Ok(if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Runs the cases on all cores. Returns the number of failures.
fn of_kind(kind: Kind, first: u64, cases: u64) -> usize {
    let start = Instant::now();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let found = Mutex::new(Vec::new());
    // Present seed and number of started cases of each thread.
    let progress: Vec<(AtomicU64, AtomicU64)> = (0..cores).map(|_| Default::default()).collect();
    std::thread::scope(|scope| {
        let threads: Vec<_> = progress
            .iter()
            .map(|(present, started)| {
                scope.spawn(|| {
                    loop {
                        let k = next.fetch_add(1, Ordering::Relaxed);
                        if k >= cases || stop.load(Ordering::Relaxed) {
                            return;
                        }
                        let seed = first.wrapping_add(k);
                        present.store(seed, Ordering::Relaxed);
                        started.fetch_add(1, Ordering::Relaxed);
                        if catch_unwind(|| kind.run(seed)).is_err() {
                            let mut found = found.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                            found.push(seed);
                            stop.store(found.len() >= MAX_FAILURES, Ordering::Relaxed);
                        }
                    }
                })
            })
            .collect();
        // Checks are counted, not seconds: they pause with this program.
        let mut checks = vec![(0, 0); cores];
        while !threads.iter().all(|thread| thread.is_finished()) {
            std::thread::sleep(CHECK_INTERVAL);
            for (((seed, started), thread), (before, idle)) in progress.iter().zip(&threads).zip(&mut checks) {
                let started = started.load(Ordering::Relaxed);
                *idle = if started == *before && !thread.is_finished() { *idle + 1 } else { 0 };
                *before = started;
                if *idle > MAX_CHECKS {
                    // A thread cannot be stopped.
                    eprintln!("{} {}: does not end", kind.name, seed.load(Ordering::Relaxed));
                    std::process::exit(1);
                }
            }
        }
    });
    let found = found.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    let done = next.load(Ordering::Relaxed).min(cases);
    println!("{:<12} {done} cases in {:.0} s, {} found", kind.name, start.elapsed().as_secs_f64(), found.len());
    for seed in &found {
        println!("  again: cargo run --release -p hyst-tests --example fuzz -- {} {seed}", kind.name);
    }
    // Shows the progress also in a pipe.
    let _ = std::io::stdout().flush();
    found.len()
}
