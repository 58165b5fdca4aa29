//! Bytes and frames by chance on all cores: `cargo run --release -p hyst-tests --example fuzz -- [CASES [FIRST_SEED]]`; one case that
//! has found something: `… -- KIND SEED`; cases of one kind: `… -- KIND FIRST_SEED CASES`.

use std::error::Error;
use std::io::Write;
use std::panic::catch_unwind;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hyst_tests::fuzz::{KINDS, Kind};

/// How often it is looked whether a case has ended, and how often in vain before it counts as one that never does.
const LOOK: Duration = Duration::from_millis(20);
const IN_VAIN: u32 = 1000;
/// Findings of one kind after which the next kind is tried.
const MOST: usize = 5;

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
    let number = |k: usize, usual: u64| arguments.get(k).map_or(Ok(usual), |text| text.parse());
    let (cases, first) = (number(0, 1_000_000)?, number(1, 0)?);
    let began = Instant::now();
    let mut found = 0;
    for kind in KINDS {
        found += of_kind(*kind, first, cases);
    }
    println!("{} kinds of {cases} cases in {:.0} s: {found} found", KINDS.len(), began.elapsed().as_secs_f64());
    Ok(if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Runs the cases on all cores; gives how many found something.
fn of_kind(kind: Kind, first: u64, cases: u64) -> usize {
    let began = Instant::now();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, over) = (AtomicU64::new(0), AtomicBool::new(false));
    let found = Mutex::new(Vec::new());
    // What each thread does, and how many it has done.
    let busy: Vec<(AtomicU64, AtomicU64)> = (0..cores).map(|_| Default::default()).collect();
    std::thread::scope(|scope| {
        let threads: Vec<_> = busy
            .iter()
            .map(|(which, done)| {
                scope.spawn(|| {
                    loop {
                        let k = next.fetch_add(1, Ordering::Relaxed);
                        if k >= cases || over.load(Ordering::Relaxed) {
                            return;
                        }
                        let seed = first.wrapping_add(k);
                        which.store(seed, Ordering::Relaxed);
                        done.fetch_add(1, Ordering::Relaxed);
                        if catch_unwind(|| kind.run(seed)).is_err() {
                            let mut found = found.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                            found.push(seed);
                            over.store(found.len() >= MOST, Ordering::Relaxed);
                        }
                    }
                })
            })
            .collect();
        // Looks are counted, not seconds: who stops this program for a while stops them too.
        let mut looks = vec![(0, 0); cores];
        while !threads.iter().all(|thread| thread.is_finished()) {
            std::thread::sleep(LOOK);
            for (((seed, done), thread), (before, in_vain)) in busy.iter().zip(&threads).zip(&mut looks) {
                let done = done.load(Ordering::Relaxed);
                *in_vain = if done == *before && !thread.is_finished() { *in_vain + 1 } else { 0 };
                *before = done;
                if *in_vain > IN_VAIN {
                    // There is no way to end it.
                    eprintln!("{} {}: does not end", kind.name, seed.load(Ordering::Relaxed));
                    std::process::exit(1);
                }
            }
        }
    });
    let found = found.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    let done = next.load(Ordering::Relaxed).min(cases);
    println!("{:<12} {done} cases in {:.0} s, {} found", kind.name, began.elapsed().as_secs_f64(), found.len());
    for seed in &found {
        println!("  again: cargo run --release -p hyst-tests --example fuzz -- {} {seed}", kind.name);
    }
    // Whoever waits for it sees how far it is.
    let _ = std::io::stdout().flush();
    found.len()
}
