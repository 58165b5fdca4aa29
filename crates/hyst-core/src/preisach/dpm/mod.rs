//! The dynamic Preisach model: a classical model whose branches have weights that depend on the rate.

use super::{Everett, Mirror, MirrorParams, PreisachParams, Reversals};
use crate::error::within;
use crate::{Build, Env, Error, Meta, Params, Probe, Real, Sampling, Stage};

mod inverse;
mod path;
#[cfg(test)]
mod tests;

pub use inverse::DpmSurfaceInverse;
pub use path::DpmState;
use path::{Note, Path, Start};

/// Parameters of the dynamic Preisach model. `L` is any list of numbers: a vector, an array, a slice.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DpmParams<L> {
    /// The classical model.
    pub preisach: PreisachParams<L>,
    /// The mirror function.
    pub mirror: MirrorParams<L>,
    /// Travel of the input over which the step at a closing loop decays to 1/e \[u\]. Zero: the step does not decay.
    pub fade: f64,
}

impl<L: AsMut<[f64]>> Params for DpmParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let classical = ["preisach.low", "preisach.high", "preisach.rest", "preisach.density", "preisach.once"];
        self.preisach.visit_as(classical, f);
        let mirror =
            ["mirror.rate_low", "mirror.rate_high", "mirror.change_low", "mirror.change_high", "mirror.weights"];
        self.mirror.visit_as(mirror, f);
        f(&Meta { name: "fade", unit: "u", lower: 0.0, upper: f64::INFINITY }, &mut self.fade);
    }
}

/// Names of the classical model in errors, and the names here.
const PREISACH: [(&str, &str); 9] = [
    ("preisach.low", "dpm.preisach.low"),
    ("preisach.high", "dpm.preisach.high"),
    ("above preisach.low", "above dpm.preisach.low"),
    ("preisach.rest", "dpm.preisach.rest"),
    ("preisach.cells", "dpm.preisach.cells"),
    ("preisach nodes", "dpm.preisach nodes"),
    ("preisach surface", "dpm.preisach surface"),
    ("preisach virgin curve", "dpm.preisach virgin curve"),
    (
        "preisach.density or preisach.once and the triangle of preisach.cells",
        "dpm.preisach.density or dpm.preisach.once and the triangle of dpm.preisach.cells",
    ),
];

/// Names of the mirror function in errors, and the names here.
const MIRROR: [(&str, &str); 10] = [
    ("mirror.rate_low", "dpm.mirror.rate_low"),
    ("mirror.rate_high", "dpm.mirror.rate_high"),
    ("above mirror.rate_low", "above dpm.mirror.rate_low"),
    ("mirror.rates", "dpm.mirror.rates"),
    ("mirror.change_low", "dpm.mirror.change_low"),
    ("mirror.change_high", "dpm.mirror.change_high"),
    ("above mirror.change_low", "above dpm.mirror.change_low"),
    ("mirror.changes", "dpm.mirror.changes"),
    ("mirror.weights", "dpm.mirror.weights"),
    (
        "mirror.weights and mirror.rates × mirror.changes",
        "dpm.mirror.weights and dpm.mirror.rates × dpm.mirror.changes",
    ),
];

impl<T: Real, L: AsRef<[f64]>, const N: usize, const R: usize, const C: usize> Build<Dpm<T, N, R, C>> for DpmParams<L> {
    type Context = Sampling;

    /// # Errors
    /// As for the two parts, or if `fade` is negative or not finite.
    fn build(&self, cx: &Sampling) -> Result<Dpm<T, N, R, C>, Error> {
        let map = self.preisach.build(&()).map_err(|e| e.in_words(&PREISACH))?;
        let mirror = self.mirror.build(&()).map_err(|e| e.in_words(&MIRROR))?;
        Dpm::new(map, mirror, self.fade, cx)
    }
}

/// Dynamic Preisach model (Chen et al.): the classical operator F, whose branches are weighted by a mirror function,
///
/// ```text
/// y = Y_r + ξ(D, P) · (F(u) − F_r) + δ,    P = u − u_r,    D = |P| / (n h).
/// ```
///
/// r is the reversal at which the present branch started. Y_r is the same expression, without δ, at that reversal.
/// Written out this is the sum of eq. 6 and 7: each dominating reversal on the stack keeps the term `ξ(Dᵢ, Pᵢ) Eᵢ` of
/// the branch that led to it, and the present branch has D_t and P_t (eq. 3 and 4). With ξ ≡ 1 it is the classical
/// operator. The Everett map has `N` nodes, the mirror function `R` by `C`.
///
/// **Time.** With `fade` = 0 all is as in eq. 3, 4, 6 and 7: n counts the samples (of period h) since the reversal,
/// including those of inner loops. With `fade` > 0, n counts the samples on the branch, without those of inner loops
/// that started and closed since. So a closed cycle has no effect except δ. The sample in which the input leaves a
/// reversal counts as part of the previous branch. So an input at rest and an input that starts to reverse give the
/// same output. Counters are integers and stop at 2³² − 1, also in `f32`. After `reset` the input has always been at
/// u0: the output is the classical one, and the first branch starts there.
///
/// **Closing loops.** If a loop starts on a branch of weight ξ₁ and closes on one of weight ξ₂, eq. 6 has a step of
/// `(ξ₂ − ξ₁) E(M, m)`. The offset δ compensates this step, so within every sample the output is a continuous function
/// of the input. δ decays as the input travels: `δ ← δ exp(−|Δu| / fade)`. With `fade` = 0 there is no δ, and the steps
/// remain, as in the paper.
///
/// **Bound.** Let Ω = ξ_max − ξ_min ([`Mirror::range`]), E₀ the largest Everett value of the inputs that occur, and S
/// the largest `E(α, β) / (α − β)`. A loop of swing s adds at most Ω S s to |δ|, and takes 2 s of travel that no other
/// loop takes. So loops that close one after another give `|δ| ≤ Ω S s / (1 − exp(−2 s / fade)) ≤ Ω S (s + fade / 2)`.
/// Nested loops may all close at once. While the input travels by `fade`, at most the N earlier pairs on the stack
/// close, each with at most Ω E₀, and new loops, with at most Ω S fade / 2 in total. Earlier contributions have decayed
/// by 1/e for each further `fade`, so always `|δ| ≤ Ω (N E₀ + S fade / 2) / (1 − 1/e)`. The output without δ is a sum
/// of at most 2 N + 1 terms. It differs from the classical output times (ξ_max + ξ_min) / 2 by at most Ω (2 N + 1) E₀.
///
/// A pair that is removed from a full stack ([`Reversals`]) is treated as a closed loop: its contribution, at most a
/// constant times its swing, is added to δ. So the output does not change, and only the constant of the bound changes.
///
/// The bound is wide for a reason: if ξ is larger on rising than on falling branches, a slowly decaying oscillation
/// drifts while its loops are open (as in eq. 6 and 17). After they have closed, the drift decays.
///
/// **Inverse.** [`Search`](crate::Search) with [`Probe`]. If `fade` > 0 it is exact to its tolerance for every output
/// that its range of inputs reaches. It is unique where the output rises with the input;
/// [`least_slope`](Self::least_slope) gives a sufficient condition. With `fade` = 0, outputs inside a step are not
/// reached. [`DpmSurfaceInverse`] is the approximation of the paper.
///
/// ```
/// use hyst_core::{Build, Dpm, DpmParams, Env, MirrorParams, PreisachParams, Sampling, Search, Stage};
/// let (density, once): (Vec<f64>, Vec<f64>) =
///     ((0..4).flat_map(|a| (0..=a).map(move |b| if a == b { 2.0 } else { 0.5 })).collect(), vec![0.0; 4]);
/// let params = DpmParams {
///     preisach: PreisachParams { low: 0.0, high: 80.0, cells: 4, rest: 0.0, density, once },
///     mirror: MirrorParams {
///         rate_low: 2e3,
///         rate_high: 16e3,
///         rates: 2,
///         change_low: -80.0,
///         change_high: 80.0,
///         changes: 2,
///         weights: vec![0.95, 0.97, 0.85, 0.9],
///     },
///     fade: 20.0,
/// };
/// let model: Dpm<f64, 5, 2, 2> = params.build(&Sampling { period: 1e-4 })?;
/// assert!(model.least_slope() > 0.0);
/// let inverse = Search::new(model.clone(), 0.0, 80.0, 1e-10)?;
/// let (mut forward, mut backward, env) = (model.state(), inverse.state(), Env::default());
/// model.reset(&mut forward, &env, 0.0);
/// inverse.reset(&mut backward, &env, 0.0);
/// for k in 1..200 {
///     let reference = 4.5 - 3.5 * (0.2 * k as f64).cos();
///     let drive = inverse.step(&mut backward, &env, reference);
///     assert!((model.step(&mut forward, &env, drive) - reference).abs() < 1e-9);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Dpm<T, const N: usize, const R: usize, const C: usize> {
    map: Everett<T, N>,
    mirror: Mirror<T, R, C>,
    per_period: T,
    /// `None` if steps do not decay.
    per_fade: Option<T>,
    /// Whether eq. 17 replaces eq. 6 and 7.
    drifting: bool,
}

/// The result of a trial input.
struct Trial<'a, T, const N: usize> {
    path: Path<'a, T, N>,
    input: T,
    classical: T,
    output: T,
    offset: T,
}

impl<T: Real, const N: usize, const R: usize, const C: usize> Dpm<T, N, R, C> {
    /// Creates the model from the classical model, the mirror function, and the travel over which the step at a closing
    /// loop decays \[input unit\].
    ///
    /// # Errors
    /// If the sample period is not positive, or `fade` is negative or not finite.
    pub fn new(map: Everett<T, N>, mirror: Mirror<T, R, C>, fade: f64, cx: &Sampling) -> Result<Self, Error> {
        within("dpm.fade", fade, fade >= 0.0, "zero or positive")?;
        let per_fade = if fade > 0.0 { Some(T::from_f64(1.0 / fade)) } else { None };
        Ok(Self { map, mirror, per_period: T::from_f64(1.0 / cx.checked()?), per_fade, drifting: false })
    }

    /// Returns the model with the recursion of eq. 17: `y = F(t_i) + ξ (F_cpm − F_cpm(t_i))`, where t_i is the last
    /// reversal, also if loops have closed since. It is continuous at closing loops without an offset, but differences
    /// of the weights accumulate without bound. Each cycle between two inputs adds (ξ_up − ξ_down) E: 2.88 N per 80 V
    /// sawtooth at ξ = 1 / 0.8 and 0.18 N/V.
    #[must_use]
    pub fn drifting(self) -> Self {
        Self { drifting: true, ..self }
    }

    /// Returns the classical model.
    pub fn map(&self) -> &Everett<T, N> {
        &self.map
    }

    /// Returns the mirror function.
    pub fn mirror(&self) -> &Mirror<T, R, C> {
        &self.mirror
    }

    /// Returns a lower bound of the slope of every branch on the grid at any rate \[output unit / input unit\].
    ///
    /// If it is positive, the output rises strictly with the present input where `|δ| < fade × slope`
    /// ([`DpmState::offset`]), and the inverse is unique there. A larger offset may decay faster than a branch rises.
    ///
    /// Along the ray of its rate a branch is ξ = ψ(|P|) times the classical gain G(|P|), with the slope ψ G' + ψ' G. If
    /// no branch of the map has a slope below κ times an earlier slope of the same branch, then |P| G' ≥ κ G. So
    /// `κ ξ + D ∂ξ/∂D + P ∂ξ/∂P > 0` for all D and P ([`Mirror::least_rise`]) is sufficient: the slope is at least G'
    /// times the smaller of ξ and this sum divided by κ. (This holds for maps without negative densities. With them,
    /// branches that leave virgin memory in the middle of a grid are not covered.)
    pub fn least_slope(&self) -> T {
        let (slope, kappa) = self.map.slopes();
        if slope <= T::ZERO || kappa <= T::ZERO {
            return T::ZERO;
        }
        let share = self.mirror.range().0.at_most(self.mirror.least_rise(kappa) / kappa);
        slope * share
    }

    /// Returns whether time is counted as in the paper. Then the output can jump, and no input reaches outputs in a
    /// jump.
    #[inline]
    fn as_published(&self) -> bool {
        self.per_fade.is_none() || self.drifting
    }

    /// Computes the output without the offset from the classical output, `age` samples after `start`.
    #[inline]
    fn weighted(&self, start: Start<T>, age: u32, u: T, classical: T) -> T {
        let change = u - start.at;
        let rate = change.abs() * self.per_period / T::from_f64(f64::from(age.max(1)));
        start.output + self.mirror.weight(rate, change) * (classical - start.classical)
    }

    /// Computes the classical and the weighted output at `u` on the present branch of `path`.
    #[inline]
    fn outputs(&self, path: &Path<'_, T, N>, u: T) -> (T, T) {
        let classical = self.map.on_branch(path.branch(), path.rising(), u);
        (classical, self.weighted(path.start(), path.age, u, classical))
    }

    #[inline]
    fn faded(&self, offset: T, travel: T) -> T {
        match self.per_fade {
            Some(per_fade) if offset != T::ZERO => offset * (-(travel.abs() * per_fade)).exp(),
            _ => T::ZERO,
        }
    }

    /// Computes the next sample for the input `u`.
    #[inline]
    fn trial<'a>(&self, s: &'a DpmState<T, N>, u: T) -> Trial<'a, T, N> {
        let memory = &s.memory;
        let now = memory.now();
        let input = if u.is_finite() { u } else { now };
        let mut path = Path {
            memory,
            len: memory.len(),
            new: None,
            untimed: s.untimed,
            start: s.start,
            age: s.age.saturating_add(1),
        };
        let up = if input == now { memory.rising() } else { input > now };
        if up != memory.rising() {
            let classical = memory.output();
            if self.as_published() {
                // The reversal was at the last sample, and the branch that led to it ended there.
                path.age = s.age;
            }
            let output = self.weighted(path.start(), path.age, now, classical);
            path.reverse(Start { at: now, classical, output }, self.drifting);
        }
        let (mut offset, mut from) = (s.offset, now);
        while let Some(target) = path.target() {
            if if up { input < target } else { input > target } {
                break;
            }
            if self.per_fade.is_none() {
                path.close(self.as_published());
                continue;
            }
            let (_, before) = self.outputs(&path, target);
            path.close(self.as_published());
            let (_, after) = self.outputs(&path, target);
            offset = self.faded(offset, target - from) + (before - after);
            from = target;
        }
        let (classical, output) = self.outputs(&path, input);
        Trial { path, input, classical, output, offset: self.faded(offset, input - from) }
    }

    /// Removes the pair `k` from the full stack as if its loop had closed, so the next reversal ends the branch that
    /// the pair interrupted. `last` is the reversal that will be stored. Returns the resulting changes of the classical
    /// output and of the weighted output.
    fn remove_pair(&self, s: &mut DpmState<T, N>, k: usize, last: &mut (Start<T>, u32)) -> (T, T) {
        let read = |k: usize| {
            let ((at, classical), note) = (s.memory.reversal(k)?, s.memory.note(k)?);
            Some((Start { at, classical, output: note.output }, note.age))
        };
        if k < s.untimed {
            // A loop that did not occur. If only its end occurred, the branch from there continues.
            if let (true, Some((end, _))) = (k + 1 == s.untimed, read(k + 1)) {
                s.start = end;
            }
            s.untimed -= (s.untimed - k).min(2);
            s.memory.remove(k);
            return (T::ZERO, T::ZERO);
        }
        let before = k.checked_sub(1);
        let start = before.filter(|b| *b >= s.untimed).and_then(read).map_or(s.start, |r| r.0);
        let age = read(k).map_or(1, |r| r.1);
        let (next, _) = read(k + 2).filter(|_| k + 2 < s.memory.len()).unwrap_or(*last);
        // Maxima are at even indices: a rising branch leads to them.
        let branch = before.and_then(|b| s.memory.reversal(b));
        let classical = self.map.on_branch(branch, k.is_multiple_of(2), next.at);
        let output = self.weighted(start, age, next.at, classical);
        let (by_classical, by_output) = (classical - next.classical, output - next.output);
        s.memory.remove(k);
        let mut ended = Some(age);
        for (y, note) in s.memory.tail_mut(k) {
            *y += by_classical;
            note.output += by_output;
            note.age = ended.take().unwrap_or(note.age);
        }
        last.0.classical += by_classical;
        last.0.output += by_output;
        last.1 = ended.unwrap_or(last.1);
        (by_classical, by_output)
    }
}

impl<T: Real, const N: usize, const R: usize, const C: usize> Stage<T> for Dpm<T, N, R, C> {
    type State = DpmState<T, N>;

    fn state(&self) -> Self::State {
        DpmState {
            memory: Reversals::new(T::ZERO, T::ZERO),
            untimed: 0,
            start: Start::default(),
            age: 0,
            offset: T::ZERO,
            zero: T::ZERO,
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let mut classical = self.map.state();
        let y = self.map.reset(&mut classical, e, u0);
        s.zero = classical.zero;
        s.memory = classical.memory.with_notes();
        s.untimed = s.memory.len();
        s.start = Start { at: s.memory.now(), classical: s.memory.output(), output: s.memory.output() };
        (s.age, s.offset) = (0, T::ZERO);
        y
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let Trial { path, input, classical, output, offset } = self.trial(s, u);
        let Path { len, new, untimed, start, age, .. } = path;
        (s.untimed, s.start, s.age, s.offset) = (untimed, start, age, offset);
        let mut shift = T::ZERO;
        match new {
            Some(mut last) if len > s.memory.len() => {
                if let Some(k) = s.memory.pair_to_remove() {
                    let (by_classical, by_output) = self.remove_pair(s, k, &mut last);
                    shift = by_classical;
                    if self.per_fade.is_some() {
                        s.offset -= by_output;
                    }
                    s.memory.set(s.memory.now(), last.0.classical);
                }
                s.memory.push(Note { output: last.0.output, age: last.1 });
            }
            _ => s.memory.truncate(len),
        }
        s.memory.set(input, classical + shift);
        output + offset - s.zero
    }
}

impl<T: Real, const N: usize, const R: usize, const C: usize> Probe<T> for Dpm<T, N, R, C> {
    #[inline]
    fn probe(&self, s: &Self::State, _: &Env<T>, u: T) -> T {
        let t = self.trial(s, u);
        t.output + t.offset - s.zero
    }
}
