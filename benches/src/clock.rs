//! Time that passed, and time that the processors worked for this program.

use std::time::Instant;

/// What something cost.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Spent {
    /// By the clock on the wall \[s\].
    pub wall: f64,
    /// By all cores together \[s\]; little affected by what else the machine is doing. `None` where the system does not say.
    pub cpu: Option<f64>,
}

/// Runs something and says what it cost. Threads that end on the way take their share of `cpu` with them; those of a pool stay.
pub fn timed<T>(run: impl FnOnce() -> T) -> (T, Spent) {
    let (cpu, start) = (on_cores(), Instant::now());
    let out = run();
    let wall = start.elapsed().as_secs_f64();
    let cpu = on_cores().zip(cpu).map(|(now, before)| now - before);
    (out, Spent { wall, cpu })
}

/// The shortest of some runs \[s\].
pub fn shortest(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs).map(|_| timed(&mut run).1.wall).fold(f64::INFINITY, f64::min)
}

/// Time on a core of all living threads \[s\], from what Linux counts in nanoseconds.
fn on_cores() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        // A thread may end while they are listed.
        let Ok(line) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else { continue };
        sum += line.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    Some(1e-9 * sum)
}
