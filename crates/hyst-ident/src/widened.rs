//! Columns of the play operators of a widening.

use std::ops::Range;

use hyst_core::{Env, Stage, Widening};

/// Returns one column per play operator, with weight one, over the segments of a drive, each after its history `pasts`.
/// `stage` returns the widening of a segment by its number; `None` gives zeros. The felt rate is computed once for all
/// operators. The columns are negative if the output falls with the drive (`falls`).
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
