//! A bed of many independent play operators with random thresholds and weights.
//!
//! A play operator keeps `|u − p| ≤ r`. Unlike loops of relays, loops of play operators are symmetric about their
//! centre, and their branches depend only on the travel since the last reversal.

use super::rng::Draws;

/// A play operator: threshold \[V\] and weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Play {
    pub(crate) threshold: f64,
    pub(crate) weight: f64,
}

/// Rate-independent play operators with the output `Σ w p`.
///
/// On a branch, the play operators in motion are always those with the smallest thresholds. So a branch only moves the
/// index `pushed`, and a reversal stores the positions of the play operators below it.
#[derive(Debug, Clone)]
pub(crate) struct PlayBed {
    /// Ascending in the threshold.
    plays: Vec<Play>,
    /// Sums of `w` and of `w r` over the first 0, 1, … n play operators.
    weights: Vec<f64>,
    moments: Vec<f64>,
    rest: f64,
    now: Memory,
    virgin: Memory,
}

#[derive(Debug, Clone)]
struct Memory {
    /// Positions, counted from rest \[V\]; outdated for the play operators in motion.
    positions: Vec<f64>,
    /// Sums of `w p` from play operator 0, 1, … n on, over those that are not in motion.
    beyond: Vec<f64>,
    /// `plays[..pushed]` are in motion.
    pushed: usize,
    /// Input, counted from rest \[V\], and its direction: 1 up, −1 down.
    input: f64,
    direction: f64,
}

impl PlayBed {
    /// Returns a virgin bed of play operators in ascending order of their thresholds, at the input `rest`.
    pub(crate) fn new(plays: &[Play], rest: f64) -> Self {
        let sums = |term: fn(&Play) -> f64| {
            let rising = plays.iter().scan(0.0, |sum, play| {
                *sum += term(play);
                Some(*sum)
            });
            std::iter::once(0.0).chain(rising).collect()
        };
        let n = plays.len();
        let virgin =
            Memory { positions: vec![0.0; n], beyond: vec![0.0; n + 1], pushed: 0, input: 0.0, direction: 1.0 };
        Self {
            plays: plays.to_vec(),
            weights: sums(|play| play.weight),
            moments: sums(|play| play.weight * play.threshold),
            rest,
            now: virgin.clone(),
            virgin,
        }
    }

    /// Moves the input monotonically to `v` and returns `Σ w p`, counted from rest.
    pub(crate) fn move_to(&mut self, v: f64) -> f64 {
        let u = v - self.rest;
        let direction = if u < self.now.input { -1.0 } else { 1.0 };
        if direction != self.now.direction && u != self.now.input {
            self.reverse();
            self.now.direction = direction;
        }
        let now = &mut self.now;
        now.input = u;
        let ahead = self.plays.iter().zip(&now.positions).skip(now.pushed);
        now.pushed += ahead.take_while(|(play, position)| now.direction * (u - **position) > play.threshold).count();
        u * self.weights[now.pushed] - now.direction * self.moments[now.pushed] + now.beyond[now.pushed]
    }

    /// Stores the positions of the play operators in motion.
    fn reverse(&mut self) {
        let Memory { positions, beyond, pushed, input, direction } = &mut self.now;
        for i in (0..*pushed).rev() {
            let play = self.plays[i];
            positions[i] = *input - *direction * play.threshold;
            beyond[i] = beyond[i + 1] + play.weight * positions[i];
        }
        *pushed = 0;
    }

    /// Returns to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

/// Draws play operators for a voltage span, in ascending order of their thresholds.
///
/// The shape of the density is also random: thresholds from a narrow distribution and a wide one that reaches beyond
/// half the span, and weights that increase or decrease with the threshold.
pub(crate) fn draw_plays(draws: &mut Draws, plays: usize, span: f64) -> Vec<Play> {
    let narrow_share = draws.between(0.3, 0.6);
    let narrow = draws.between(0.04, 0.09);
    let widest = draws.between(0.45, 0.7);
    let tilt = draws.between(-0.5, 0.5);
    let mut drawn: Vec<Play> = (0..plays)
        .map(|_| {
            let narrow_one = draws.unit() < narrow_share;
            let ratio = if narrow_one { narrow * draws.exponential() } else { draws.between(0.0, widest) };
            let along = (4.0 * ratio - 1.0).min(1.0);
            Play { threshold: span * ratio, weight: draws.exponential() * (1.0 + tilt * along) }
        })
        .collect();
    drawn.sort_unstable_by(|a, b| a.threshold.total_cmp(&b.threshold).then(a.weight.total_cmp(&b.weight)));
    drawn
}

#[cfg(test)]
mod tests {
    use super::super::rng::Purpose;
    use super::*;

    #[test]
    fn the_bed_agrees_with_a_sum_over_all_play_operators() {
        let mut draws = Draws::new(5, Purpose::Plays);
        let plays = draw_plays(&mut draws, 400, 100.0);
        let mut bed = PlayBed::new(&plays, 20.0);
        let mut positions = vec![0.0_f64; plays.len()];
        for k in 0..3000 {
            // Also without motion, and back to the previous voltage.
            let v = if k % 7 == 0 { 50.0 } else { draws.between(-10.0, 110.0) };
            for v in [v, v, v + 1.0] {
                let output = bed.move_to(v);
                for (p, play) in positions.iter_mut().zip(&plays) {
                    *p = p.clamp(v - 20.0 - play.threshold, v - 20.0 + play.threshold);
                }
                let expected: f64 = positions.iter().zip(&plays).map(|(p, play)| p * play.weight).sum();
                assert!((output - expected).abs() < 1e-9, "{k}: {output} {expected}");
            }
        }
        bed.reset();
        assert_eq!(bed.move_to(20.0), 0.0);
    }

    #[test]
    fn thresholds_are_sorted_and_weights_are_positive() {
        for seed in 0..20 {
            let plays = draw_plays(&mut Draws::new(seed, Purpose::Plays), 3000, 120.0);
            assert!(plays.is_sorted_by(|a, b| a.threshold <= b.threshold));
            assert!(plays.iter().all(|play| play.threshold >= 0.0 && play.weight > 0.0));
            assert!(plays.iter().filter(|play| play.threshold < 60.0).count() > 2000);
        }
    }
}
