//! Drives as sequences of reversals.

/// Number of reversals of a decaying drive (demagnetisation).
const DECAY_REVERSALS: usize = 16;
/// Rows from one reversal to the next.
pub(super) const ROWS_PER_REVERSAL: usize = 16;

/// Returns the reversals of a drive from 0 V that a memory with wiping-out still contains at its end.
pub(super) fn in_force<'a>(drive: impl Iterator<Item = &'a f64>) -> Vec<f64> {
    let mut turns: Vec<f64> = vec![0.0];
    for u in drive.copied() {
        // A continued motion is not a reversal. A motion beyond an earlier reversal wipes out that one and the one
        // after it.
        while let [.., a, b] = turns[..]
            && ((u - b) * (b - a) >= 0.0 || (turns.len() > 2 && (u - a) * (b - a) <= 0.0))
        {
            let continues = (u - b) * (b - a) >= 0.0;
            turns.truncate(turns.len() - if continues { 1 } else { 2 });
        }
        turns.push(u);
    }
    turns.remove(0);
    turns
}

/// Returns a drive that oscillates about `u0` with decreasing amplitude, as in demagnetisation \[V\].
pub(super) fn decay(u0: f64, amplitude: f64) -> Vec<f64> {
    let turn = |k: usize| {
        let size = amplitude * (1.0 - k as f64 / DECAY_REVERSALS as f64);
        u0 + if k.is_multiple_of(2) { size } else { -size }
    };
    path(&(0..DECAY_REVERSALS).map(turn).collect::<Vec<f64>>(), u0)
}

/// Returns a drive from 0 V from reversal to reversal and towards `u0`, without `u0` itself.
pub(super) fn path(turns: &[f64], u0: f64) -> Vec<f64> {
    let mut from = 0.0;
    let mut path = vec![from];
    for to in turns.iter().copied().chain([u0]) {
        path.extend((1..=ROWS_PER_REVERSAL).map(|i| from + (to - from) * i as f64 / ROWS_PER_REVERSAL as f64));
        from = to;
    }
    path.pop();
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Basis, Drag, PiBasis};

    #[test]
    fn a_memory_keeps_the_reversals_that_were_not_exceeded_later() {
        let kept = |drive: &[f64]| in_force(drive.iter());
        assert_eq!(kept(&[1.0, 2.0, 5.0, 3.0, 4.0]), [5.0, 3.0, 4.0]);
        // A closed loop is wiped out, wherever it is in the drive.
        assert_eq!(kept(&[5.0, 3.0, 4.0, 2.0, 4.5]), [5.0, 2.0, 4.5]);
        assert_eq!(kept(&[5.0, 3.0, 4.0, 2.0, 6.0]), [6.0]);
        assert_eq!(kept(&[]), [0.0; 0]);
    }

    /// The reversals in force have the same effect as the whole drive.
    #[test]
    fn the_reversals_in_force_replace_the_whole_drive() {
        let drive: Vec<f64> =
            (0..900).map(|k| 50.0 + 45.0 * (0.05 * f64::from(k)).sin() * (0.011 * f64::from(k)).cos()).collect();
        let (u0, after) = (drive[899], [70.0, 30.0, 60.0]);
        let whole: Vec<f64> = drive.iter().chain(&after).copied().collect();
        let short: Vec<f64> = path(&in_force(drive.iter()), u0).into_iter().chain([u0]).chain(after).collect();
        let plays =
            PiBasis { thresholds: vec![4.0, 11.0, 23.0, 46.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let last = |drive: &[f64]| {
            let columns = plays.columns(0..5, drive, std::slice::from_ref(&(0..drive.len())), &Drag::NONE);
            columns.iter().map(|c| c[drive.len() - 1]).collect::<Vec<_>>()
        };
        assert_eq!(last(&whole), last(&short));
    }
}
