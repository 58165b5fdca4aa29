//! Tests of the dynamic Preisach model: its equations, continuity, bounds and state.

use super::super::Grid;
use super::*;
use proptest::prelude::*;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

mod parameters;
mod single_precision;

pub(super) const PERIOD: Sampling = Sampling { period: 1e-4 };
pub(super) const CELLS: usize = 16;
pub(super) const HIGH: f64 = 80.0;
pub(super) type Model = Dpm<f64, 17, 8, 9>;

/// Returns a map with 14.4 N from 0 to 80 V (0.18 N/V): half of it reversible, half from relays near one point.
pub(super) fn map(rest: f64) -> Everett<f64, 17> {
    let at = |k: usize| (k as f64 + 0.5) / CELLS as f64;
    let relays = |a: f64, b: f64| libm::exp(-3.0 * ((a - 0.6) * (a - 0.6) + (b - 0.4) * (b - 0.4)));
    let mut sum = 0.0;
    for a in 0..CELLS {
        for b in 0..a {
            sum += relays(at(a), at(b));
        }
    }
    let grid = Grid { low: 0.0, high: HIGH, cells: CELLS };
    let density = |a, b| if a == b { 7.2 / CELLS as f64 } else { 7.2 / sum * relays(at(a), at(b)) };
    Everett::new(grid, rest, density, |_| 0.0).unwrap()
}

/// The grid of the paper.
const GRID: MirrorParams<()> = MirrorParams::on_printed_grid(());

pub(super) fn model(rest: f64, fade: f64, xi: impl Fn(f64, f64) -> f64) -> Box<Model> {
    Box::new(Dpm::new(map(rest), Mirror::from_fn(&GRID, xi).unwrap(), fade, &PERIOD).unwrap())
}

/// A mirror function that falls with the rate, more on falling branches and for large changes.
pub(super) fn soft(d: f64, p: f64) -> f64 {
    1.0 - 0.25 * d / (d + 8e3) * (1.0 - 0.3 * p / 80.0)
}

fn run(m: &Model, rest: f64, u: &[f64]) -> Vec<f64> {
    let (mut s, e) = (m.state(), Env::default());
    m.reset(&mut s, &e, rest);
    u.iter().map(|u| m.step(&mut s, &e, *u)).collect()
}

/// Returns straight lines through turning points, with `n` samples each.
fn lines(turns: &[f64], n: usize) -> Vec<f64> {
    turns.windows(2).flat_map(|w| (1..=n).map(move |k| w[0] + (w[1] - w[0]) * k as f64 / n as f64)).collect()
}

pub(super) struct Random(pub(super) u64);
impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

proptest! {
    /// With a mirror of ones the model equals the classical operator.
    #[test]
    fn a_mirror_of_ones_gives_the_classical_model(u in prop::collection::vec(0.0..80.0f64, 20..300), middle: bool, fade in 0.0..50.0f64, drifting: bool) {
        let rest = if middle { 40.0 } else { 0.0 };
        let m = model(rest, fade, |_, _| 1.0);
        let m = if drifting { Box::new(m.drifting()) } else { m };
        let (mut s, e) = (m.map.state(), Env::default());
        m.map.reset(&mut s, &e, rest);
        let y = run(&m, rest, &u);
        for (u, y) in u.iter().zip(y) {
            prop_assert!((m.map.step(&mut s, &e, *u) - y).abs() < 1e-12);
        }
    }

    /// Eq. 6 and 7 term by term for a decaying oscillation, in which every reversal stays in force.
    #[test]
    fn output_with_open_loops_is_the_sum_of_their_terms(steps in prop::collection::vec((0.5..3.0f64, 1usize..30), 4..24), faded: bool) {
        let m = model(0.0, if faded { 20.0 } else { 0.0 }, soft);
        let mut turns = vec![(0.0, 0)];
        let (mut low, mut high) = (0.0, HIGH);
        for (k, (by, samples)) in steps.iter().enumerate() {
            if k % 2 == 0 { high -= by } else { low += by }
            turns.push((if k % 2 == 0 { high } else { low }, *samples));
        }
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, 0.0);
        let mut y = 0.0;
        let mut frozen = 0.0;
        for w in turns.windows(2) {
            let ((from, _), (to, samples)) = (w[0], w[1]);
            let gain = |u: f64| if to > from { m.map.value(u, from) } else { -m.map.value(from, u) };
            for k in 1..=samples {
                let u = from + (to - from) * k as f64 / samples as f64;
                y = m.step(&mut s, &e, u);
                let rate = (u - from).abs() / (k as f64 * 1e-4);
                prop_assert!((y - (frozen + m.mirror.weight(rate, u - from) * gain(u))).abs() < 1e-12);
            }
            // If steps decay, the sample in which the input leaves the reversal counts as part of the previous branch.
            let rate = (to - from).abs() / ((samples + usize::from(faded)) as f64 * 1e-4);
            frozen += m.mirror.weight(rate, to - from) * gain(to);
        }
        prop_assert!(y.is_finite());
    }

    /// If steps decay, closed inner loops have no effect on output and time after δ has decayed.
    #[test]
    fn closed_inner_loops_have_no_effect(inner in prop::collection::vec(30.0..60.0f64, 1..20), after in prop::collection::vec(0.0..80.0f64, 1..40)) {
        let m = model(0.0, 0.01, soft);
        let mut with = vec![70.0, 20.0, 60.0];
        with.extend(&inner);
        with.extend([65.0]);
        with.extend(&after);
        let mut without = vec![70.0, 20.0, 60.0, 59.0, 65.0];
        without.extend(&after);
        let (a, b) = (run(&m, 0.0, &with), run(&m, 0.0, &without));
        let tail = after.len() + 1;
        for (x, y) in a[a.len() - tail..].iter().zip(&b[b.len() - tail..]) {
            prop_assert!((x - y).abs() < 1e-11, "{x} {y}");
        }
    }

    /// Within one sample the output is a continuous function of the input, also at reversals and closing loops. `probe`
    /// equals `step`.
    #[test]
    fn output_is_continuous_in_the_present_input(
        u in prop::collection::vec(0.0..80.0f64, 1..60), middle: bool, fade in 5.0..60.0f64, jagged in prop::collection::vec(0.6..1.2f64, 72),
    ) {
        let rest = if middle { 40.0 } else { 0.0 };
        let m = model(rest, fade, |d, p| jagged[(d / 2e3) as usize * 9 - 9 + ((p + 80.0) / 20.0) as usize]);
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, rest);
        for u in &u {
            m.step(&mut s, &e, *u);
        }
        let at = |u: f64| m.probe(&s, &e, u);
        for u in s.in_force().iter().chain([&s.memory.now()]) {
            let jump = (at(u + 1e-9) - at(u - 1e-9)).abs().max((at(u + 1e-9) - at(*u)).abs());
            prop_assert!(jump < 1e-6, "at {u}: {jump}");
        }
        for k in 0..=64 {
            let u = 1.25 * f64::from(k);
            let mut then = s.clone();
            prop_assert_eq!(at(u), m.step(&mut then, &e, u));
        }
    }

    /// The slope of every branch is above the bound for any history and rate. Loops stay open, so δ = 0.
    #[test]
    fn slope_of_every_branch_is_above_the_bound(
        steps in prop::collection::vec((0.1..3.0f64, 1usize..40), 0..24), strength in 0.0..0.5f64, middle in 1e3..2e4f64,
    ) {
        let m = model(0.0, 0.0, |d, p| 1.0 - strength * d / (d + middle) * (1.0 - 0.3 * p / 80.0));
        let least = m.least_slope();
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, 0.0);
        let (mut low, mut high, mut now) = (0.0, HIGH, 0.0);
        for (k, (by, samples)) in steps.iter().enumerate() {
            if k % 2 == 0 { high -= by } else { low += by }
            let to = if k % 2 == 0 { high } else { low };
            for u in lines(&[now, to], *samples) {
                m.step(&mut s, &e, u);
            }
            now = to;
        }
        for k in 1..400 {
            // Nearly up to the end of the loop on both sides.
            let (a, b) = (low + (high - low) * f64::from(k) / 401.0, low + (high - low) * f64::from(k + 1) / 401.0);
            let slope = (m.probe(&s, &e, b) - m.probe(&s, &e, a)) / (b - a);
            prop_assert!(slope >= least - 1e-9, "{slope} {least}");
        }
    }
}

/// With `fade` = 0 the time of a closed loop counts, like t in eq. 3.
#[test]
fn without_decay_the_time_of_inner_loops_counts() {
    let m = model(0.0, 0.0, soft);
    let (mut s, e) = (m.state(), Env::default());
    m.reset(&mut s, &e, 0.0);
    let mut y = 0.0;
    for u in [20.0, 40.0, 30.0, 35.0, 60.0] {
        y = m.step(&mut s, &e, u);
    }
    let expected = m.mirror.weight(60.0 / 5e-4, 60.0) * m.map.value(60.0, 0.0);
    assert!((y - expected).abs() < 1e-12, "{y} {expected}");
}

/// The map gives 14.4 N between 0 and 80 V (0.18 N/V). ξ is 1 on rising branches, and 0.8 on falling branches from 20 V
/// of change on. Eq. 17 then drifts by 2.88 N per 80 V sawtooth.
#[test]
fn drift_per_sawtooth_of_the_three_forms() {
    let xi = |_, p: f64| if p < 0.0 { 0.8 } else { 1.0 };
    let turns: Vec<f64> = (0..41).map(|k| if k % 2 == 0 { 0.0 } else { 80.0 }).collect();
    let u = lines(&turns, 50);
    let tops = |y: &[f64]| -> Vec<f64> { y.chunks(100).map(|c| c[49]).collect() };
    assert!((map(0.0).value(80.0, 0.0) - 14.4).abs() < 1e-12);

    let drifting = tops(&run(&model(0.0, 0.0, xi).drifting(), 0.0, &u));
    for w in drifting.windows(2) {
        assert!((w[1] - w[0] - 2.88).abs() < 1e-9, "{}", w[1] - w[0]);
    }
    // The stack form returns to the same output.
    let stack = tops(&run(&model(0.0, 0.0, xi), 0.0, &u));
    assert!(stack.iter().all(|y| (y - 14.4).abs() < 1e-9), "{stack:?}");
    // With steps that decay over 40 V: a geometric series, 2.88 / (1 − exp(−160 / 40)) at each maximum.
    let faded = tops(&run(&model(0.0, 40.0, xi), 0.0, &u));
    let ratio = libm::exp(-160.0 / 40.0);
    for (k, y) in faded.iter().enumerate() {
        let expected = 14.4 + 2.88 * (1.0 - libm::pow(ratio, k as f64)) / (1.0 - ratio);
        assert!((y - expected).abs() < 1e-9, "{k}: {y} {expected}");
    }
}

#[test]
fn a_long_rest_relaxes_to_the_classical_branch() {
    let m = model(0.0, 20.0, soft);
    let (mut s, e) = (m.state(), Env::default());
    m.reset(&mut s, &e, 0.0);
    let mut last = 0.0;
    for u in lines(&[0.0, 60.0], 30) {
        last = m.step(&mut s, &e, u);
    }
    let classical = m.map.virgin(60.0);
    assert!(last < 0.93 * classical);
    for _ in 0..1_000_000 {
        let y = m.step(&mut s, &e, 60.0);
        assert!(y >= last - 1e-12 && y <= classical);
        last = y;
    }
    // D = 60 V in 100 s.
    assert!((last - classical).abs() < 1e-4 * classical);
}

/// Random, sawtooth, dithering and slowly decaying inputs: the output stays within the documented bound.
#[test]
fn output_and_offset_stay_bounded() {
    let xi = |_, p: f64| if p < 0.0 { 0.8 } else { 1.0 };
    let (e, fade) = (Env::default(), 30.0);
    let m = model(0.0, fade, xi);
    let (omega, top, pairs) = (0.2, 14.4, 17.0);
    // The steepest mean slope of any branch from 0 to 80 V, by brute force.
    let mut steep = 0.0f64;
    for a in 1..=160 {
        for b in 0..a {
            let (a, b) = (0.5 * f64::from(a), 0.5 * f64::from(b));
            steep = steep.max(m.map.value(a, b) / (a - b));
        }
    }
    let bound = omega * (pairs * top + steep * fade / 2.0) / (1.0 - libm::exp(-1.0));
    let mut random = Random(7);
    let mut walk = 40.0;
    type Drive = Box<dyn FnMut(u32) -> f64>;
    let drives: [(&str, Drive); 5] = [
        ("random", Box::new(move |_| 80.0 * random.next())),
        ("dither", Box::new(|k| if k % 2 == 0 { 70.0 } else { 70.0 - 1e-6 * f64::from(k % 5) })),
        (
            "walk",
            Box::new(move |k| {
                walk = (walk + libm::sin(f64::from(k) * 1.7) + libm::sin(f64::from(k) * 0.013)).clamp(0.0, 80.0);
                walk
            }),
        ),
        // Repeated decaying oscillations of sixteen loops that all close at once.
        (
            "spirals",
            Box::new(|k| {
                if k % 40 >= 34 {
                    80.0
                } else if k % 2 == 0 {
                    80.0 - 0.01 * f64::from(k % 40)
                } else {
                    0.01 * f64::from(k % 40)
                }
            }),
        ),
        // Loops that never close: each reversal removes a pair from the stack.
        ("decay", Box::new(|k| if k % 2 == 0 { 80.0 - 1e-6 * f64::from(k) } else { 1e-6 * f64::from(k) })),
    ];
    for (name, mut drive) in drives {
        let mut s = m.state();
        m.reset(&mut s, &e, 0.0);
        let (mut largest, mut offset) = (0.0f64, 0.0f64);
        for k in 0..1_000_000 {
            let y = m.step(&mut s, &e, drive(k));
            assert!(y.is_finite());
            (largest, offset) = (largest.max(y.abs()), offset.max(s.offset().abs()));
        }
        std::println!("{name}: |y| <= {largest:.2} N, |offset| <= {offset:.2} N of {bound:.2}");
        assert!(offset <= bound, "{name}: {offset}");
        assert!(largest <= 0.9 * top + omega * (2.0 * pairs + 1.0) * top + bound, "{name}: {largest}");
    }
}

/// Loops that never close: from the 34th reversal on, each reversal removes a pair. ξ does not depend on the rate, so
/// only the input may change the output.
#[test]
fn removal_of_a_pair_does_not_change_the_output() {
    let m = model(0.0, 25.0, |_, p| 0.9 + 0.1 * p / 80.0);
    let (mut s, e) = (m.state(), Env::default());
    m.reset(&mut s, &e, 0.0);
    let (mut full, mut change) = (0, 0.0f64);
    for k in 0..400 {
        let by = 0.09 * f64::from(k) * (1.0 + 0.3 * libm::sin(f64::from(k)));
        let u = if k % 2 == 0 { 80.0 - by } else { by };
        let before = s.offset();
        let y = m.step(&mut s, &e, u);
        assert!((m.probe(&s, &e, u) - y).abs() < 1e-12, "{k}");
        if s.in_force().len() >= 2 * 17 - 1 {
            full += 1;
            change = change.max((s.offset() - before).abs());
        }
    }
    // Pairs were removed, and the contribution of a removed loop is in the offset.
    assert!(full > 100 && change > 0.1, "{full} {change}");
}

#[test]
fn a_reset_clears_the_state_and_a_non_finite_input_holds_the_last() {
    let m = model(40.0, 20.0, soft);
    let e = Env::default();
    let (mut fresh, mut used) = (m.state(), m.state());
    m.reset(&mut used, &e, 3.0);
    let mut random = Random(3);
    for _ in 0..500 {
        m.step(&mut used, &e, 80.0 * random.next());
    }
    assert_eq!(m.reset(&mut fresh, &e, 55.0), m.reset(&mut used, &e, 55.0));
    for k in 0..500 {
        let u = 80.0 * random.next();
        assert_eq!(m.step(&mut fresh, &e, u), m.step(&mut used, &e, u));
        if k % 50 == 0 {
            let held = m.step(&mut used, &e, f64::NAN);
            assert!(held.is_finite() && held == m.step(&mut fresh, &e, u));
        }
    }
}
