//! A bed of many independent relays with random thresholds.
//!
//! There are no play operators and no threshold grid here, so that no fitted model is exact by construction.

use super::rng::Draws;

/// Relays that switch up when the input reaches `alpha`, and down when it reaches `beta < alpha`.
#[derive(Debug, Clone)]
pub(crate) struct RelayBed {
    /// Upper thresholds, ascending; the index is the relay's number.
    alpha: Vec<f64>,
    /// Lower thresholds, ascending, with the relay's number.
    beta: Vec<(f64, u32)>,
    now: BedState,
    virgin: BedState,
}

#[derive(Debug, Clone)]
struct BedState {
    up: Vec<bool>,
    /// Number of relays that are up.
    count: usize,
    /// `alpha[..reached]` are at or below the input.
    reached: usize,
    /// `beta[..passed]` are below the input.
    passed: usize,
}

impl RelayBed {
    /// Returns a virgin bed of relays `(alpha, beta)`, ascending in alpha, at the input `rest`.
    ///
    /// Relays centred below `rest` are up.
    pub(crate) fn new(thresholds: &[(f64, f64)], rest: f64) -> Self {
        let alpha: Vec<f64> = thresholds.iter().map(|t| t.0).collect();
        let mut beta: Vec<(f64, u32)> = (0_u32..).zip(thresholds).map(|(i, t)| (t.1, i)).collect();
        beta.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let up: Vec<bool> = thresholds.iter().map(|t| t.0 + t.1 < 2.0 * rest).collect();
        let virgin = BedState {
            count: up.iter().filter(|up| **up).count(),
            up,
            reached: alpha.partition_point(|a| *a <= rest),
            passed: beta.partition_point(|b| b.0 < rest),
        };
        Self { alpha, beta, now: virgin.clone(), virgin }
    }

    /// Moves the input monotonically to `u`; visits only relays with a threshold in between.
    pub(crate) fn move_to(&mut self, u: f64) {
        let now = &mut self.now;
        while now.reached < self.alpha.len() && self.alpha[now.reached] <= u {
            let up = &mut now.up[now.reached];
            now.count += usize::from(!*up);
            *up = true;
            now.reached += 1;
        }
        while now.passed > 0 && self.beta[now.passed - 1].0 >= u {
            now.passed -= 1;
            let up = &mut now.up[self.beta[now.passed].1 as usize];
            now.count -= usize::from(*up);
            *up = false;
        }
        // Update the indices for the other direction.
        while now.reached > 0 && self.alpha[now.reached - 1] > u {
            now.reached -= 1;
        }
        while now.passed < self.beta.len() && self.beta[now.passed].0 < u {
            now.passed += 1;
        }
    }

    /// Returns the number of relays that are up.
    ///
    /// All weights are equal, so the output is exact, without rounding errors.
    pub(crate) fn count(&self) -> usize {
        self.now.count
    }

    /// Returns to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

/// Draws pairs `(alpha, beta)` over `min..max`, ascending in alpha.
///
/// The shape of the density is also random. Half-widths have a mixture of an exponential and a gamma distribution, and
/// increase or decrease along the range. Centres have a mixture of a uniform distribution, which reaches beyond the
/// range, and a broad peak.
pub(crate) fn draw_thresholds(draws: &mut Draws, relays: usize, min: f64, max: f64) -> Vec<(f64, f64)> {
    let narrow_share = draws.between(0.25, 0.5);
    let narrow = draws.between(0.05, 0.09);
    let wide = draws.between(0.18, 0.26);
    let bump_share = draws.between(0.1, 0.25);
    let bump_centre = draws.between(0.4, 0.6);
    let bump_width = draws.between(0.2, 0.3);
    let tilt = draws.between(-0.15, 0.15);
    let span = max - min;
    let mut thresholds: Vec<(f64, f64)> = (0..relays)
        .map(|_| {
            let centre = if draws.unit() < bump_share {
                bump_centre + bump_width * draws.normal()
            } else {
                draws.between(-0.1, 1.1)
            };
            let law = if draws.unit() < narrow_share {
                narrow * draws.exponential()
            } else {
                0.5 * wide * (draws.exponential() + draws.exponential())
            };
            let along = (2.0 * centre - 1.0).clamp(-1.0, 1.0);
            let half_width = (law * (1.0 + tilt * along)).max(1e-6);
            (min + span * (centre + half_width), min + span * (centre - half_width))
        })
        .collect();
    thresholds.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    thresholds
}

/// Draws pairs like [`draw_thresholds`], but most of them in two clusters.
///
/// Each cluster is around one voltage and has a narrow and a wide part.
pub(crate) fn draw_clumps(draws: &mut Draws, relays: usize, min: f64, max: f64) -> Vec<(f64, f64)> {
    let scattered = draws.between(0.15, 0.3);
    let first_share = draws.between(0.4, 0.6);
    let centres = [draws.between(0.2, 0.32), draws.between(0.68, 0.8)];
    let (width, narrow, wide) = (draws.between(0.08, 0.14), draws.between(0.04, 0.08), draws.between(0.22, 0.34));
    let span = max - min;
    let mut thresholds: Vec<(f64, f64)> = (0..relays)
        .map(|_| {
            let centre = if draws.unit() < scattered {
                draws.between(-0.1, 1.1)
            } else {
                centres[usize::from(draws.unit() >= first_share)] + width * draws.normal()
            };
            let of = if draws.unit() < 0.6 { narrow } else { wide };
            let half_width = (of * (1.0 + 0.3 * draws.normal())).max(1e-6);
            (min + span * (centre + half_width), min + span * (centre - half_width))
        })
        .collect();
    thresholds.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    thresholds
}

#[cfg(test)]
mod tests {
    use super::super::rng::Purpose;
    use super::*;

    #[test]
    fn the_bed_agrees_with_a_count_over_all_relays() {
        let mut draws = Draws::new(5, Purpose::Relays);
        let thresholds = draw_thresholds(&mut draws, 500, 0.0, 100.0);
        let mut bed = RelayBed::new(&thresholds, 0.0);
        let mut naive: Vec<bool> = thresholds.iter().map(|t| t.0 + t.1 < 0.0).collect();
        for _ in 0..2000 {
            let u = draws.between(-10.0, 110.0);
            bed.move_to(u);
            for (up, (alpha, beta)) in naive.iter_mut().zip(&thresholds) {
                *up = u >= *alpha || (*up && u > *beta);
            }
            assert_eq!(bed.count(), naive.iter().filter(|up| **up).count());
        }
    }
}
