//! Elapsed time and CPU time of this program.

use std::time::Instant;

/// Elapsed time and CPU time.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Spent {
    /// Elapsed time \[s\].
    pub wall: f64,
    /// CPU time of all cores \[s\]; almost independent of other load of the machine. `None` if the system does not
    /// report it.
    pub cpu: Option<f64>,
}

/// Runs a function and measures its time. The CPU time of threads that end during the run is not counted. The CPU time
/// of pool threads is counted.
pub fn timed<T>(run: impl FnOnce() -> T) -> (T, Spent) {
    let (cpu, start) = (cpu_seconds(), Instant::now());
    let out = run();
    let wall = start.elapsed().as_secs_f64();
    let cpu = cpu_seconds().zip(cpu).map(|(now, before)| now - before);
    (out, Spent { wall, cpu })
}

/// Returns the minimum elapsed time of several runs \[s\].
pub fn shortest(runs: usize, mut run: impl FnMut()) -> f64 {
    (0..runs).map(|_| timed(&mut run).1.wall).fold(f64::INFINITY, f64::min)
}

/// Returns the CPU time of all present threads \[s\], which Linux counts in nanoseconds.
fn cpu_seconds() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        // A thread may end while they are listed.
        let Ok(line) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else { continue };
        sum += line.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    Some(1e-9 * sum)
}
