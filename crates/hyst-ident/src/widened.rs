//! What each play of a widening adds over a drive.

use std::ops::Range;

use hyst_core::{Env, Stage, Widening};

/// A column for each of `plays`, of weight one, over the segments of a drive, each after its past. `stage` holds the plays of a segment, by its number; none
/// where it cannot be built. The rate is felt once for all of them. `falls`: the columns fall where the output falls with the drive.
pub(crate) fn columns<'a>(
    plays: usize,
    stage: impl Fn(usize) -> Option<&'a Widening<f64>>,
    drive: &[f64],
    segments: &[Range<usize>],
    pasts: &[Vec<f64>],
    falls: bool,
) -> Vec<Vec<f64>> {
    let (mut columns, env) = (vec![vec![0.0; drive.len()]; plays], Env::default());
    let sign = if falls { -1.0 } else { 1.0 };
    for (i, segment) in segments.iter().enumerate() {
        let (Some(stage), Some(first)) = (stage(i), drive.get(segment.start)) else { continue };
        let mut state = stage.state();
        pasts.get(i).into_iter().flatten().for_each(|u| stage.rest(&mut state, *u));
        // The device has rested at its first input.
        stage.rest(&mut state, *first);
        for k in segment.clone().skip(1) {
            stage.step(&mut state, &env, drive[k]);
            columns.iter_mut().zip(stage.parts(&state)).for_each(|(column, part)| column[k] = sign * part);
        }
    }
    columns
}
