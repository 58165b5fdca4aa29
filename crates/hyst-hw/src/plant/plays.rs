//! A bed of many independent plays with random thresholds and weights: the other kind of hysteresis.
//!
//! A play follows its input where it is pushed, `|u − p| ≤ r`. Loops of a bed of plays are symmetric about their centre and
//! their branches are curves of the travel since the last turn alone; those of relays are neither.

use super::rng::Draws;

/// A play: threshold \[V\], weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Play {
    pub(crate) threshold: f64,
    pub(crate) weight: f64,
}

/// Plays that follow at once, in one sum `Σ w p`.
///
/// On a branch, the plays that the input pushes are always those of the smallest thresholds: a branch moves a mark and
/// touches no play, and only a turn writes down where those below the mark have been left.
#[derive(Debug, Clone)]
pub(crate) struct PlayBed {
    /// Ascending in the threshold.
    plays: Vec<Play>,
    /// Over the first 0, 1, … n plays: sums of `w` and of `w r`.
    weights: Vec<f64>,
    moments: Vec<f64>,
    rest: f64,
    now: Memory,
    virgin: Memory,
}

#[derive(Debug, Clone)]
struct Memory {
    /// Where each play has been left, counted from rest \[V\]; those that are pushed now have an old value.
    left: Vec<f64>,
    /// Sums of `w p` from the play 0, 1, … n on, over those that are not pushed.
    beyond: Vec<f64>,
    /// `plays[..pushed]` are pushed.
    pushed: usize,
    /// Input, counted from rest \[V\], and which way it went: 1 up, −1 down.
    input: f64,
    way: f64,
}

impl PlayBed {
    /// Plays in ascending order of their thresholds, all centred on the input `rest`.
    pub(crate) fn new(plays: &[Play], rest: f64) -> Self {
        let sums = |term: fn(&Play) -> f64| {
            let rising = plays.iter().scan(0.0, |sum, play| {
                *sum += term(play);
                Some(*sum)
            });
            std::iter::once(0.0).chain(rising).collect()
        };
        let n = plays.len();
        let virgin = Memory { left: vec![0.0; n], beyond: vec![0.0; n + 1], pushed: 0, input: 0.0, way: 1.0 };
        Self {
            plays: plays.to_vec(),
            weights: sums(|play| play.weight),
            moments: sums(|play| play.weight * play.threshold),
            rest,
            now: virgin.clone(),
            virgin,
        }
    }

    /// Moves the input monotonically to `v`; returns `Σ w p`, counted from rest.
    pub(crate) fn move_to(&mut self, v: f64) -> f64 {
        let u = v - self.rest;
        let way = if u < self.now.input { -1.0 } else { 1.0 };
        if way != self.now.way && u != self.now.input {
            self.turn();
            self.now.way = way;
        }
        let now = &mut self.now;
        now.input = u;
        let ahead = self.plays.iter().zip(&now.left).skip(now.pushed);
        now.pushed += ahead.take_while(|(play, left)| now.way * (u - **left) > play.threshold).count();
        u * self.weights[now.pushed] - now.way * self.moments[now.pushed] + now.beyond[now.pushed]
    }

    /// Writes down where the pushed plays are left.
    fn turn(&mut self) {
        let Memory { left, beyond, pushed, input, way } = &mut self.now;
        for i in (0..*pushed).rev() {
            let play = self.plays[i];
            left[i] = *input - *way * play.threshold;
            beyond[i] = beyond[i + 1] + play.weight * left[i];
        }
        *pushed = 0;
    }

    /// Back to the virgin state.
    pub(crate) fn reset(&mut self) {
        self.now.clone_from(&self.virgin);
    }
}

/// Draws plays for a span of voltages, in ascending order of their thresholds. The shape of the density comes from the
/// stream too: a narrow law and a wide one that reaches beyond half the span, and weights that grow or shrink along it.
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
    fn the_mark_agrees_with_asking_every_play() {
        let mut draws = Draws::new(5, Purpose::Plays);
        let plays = draw_plays(&mut draws, 400, 100.0);
        let mut bed = PlayBed::new(&plays, 20.0);
        let mut positions = vec![0.0_f64; plays.len()];
        for k in 0..3000 {
            // Also where nothing moves, and back to the voltage before.
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
    fn thresholds_rise_and_weights_are_positive() {
        for seed in 0..20 {
            let plays = draw_plays(&mut Draws::new(seed, Purpose::Plays), 3000, 120.0);
            assert!(plays.is_sorted_by(|a, b| a.threshold <= b.threshold));
            assert!(plays.iter().all(|play| play.threshold >= 0.0 && play.weight > 0.0));
            assert!(plays.iter().filter(|play| play.threshold < 60.0).count() > 2000);
        }
    }
}
