//! Properties of every model and inverse of the core, in `f32` and `f64`: the output is finite and bounded over a
//! million samples of bounded input, invalid samples have no effect, and a reset restores the initial state.

use hyst_cases::{Case, Precision, Visit, each, list};
use hyst_core::{Env, Real, Stage};

/// Random numbers from 0 to 1, the same on every machine.
struct Draw(u32);

impl Draw {
    fn next(&mut self) -> f64 {
        // Linear congruential generator of Numerical Recipes; its high bits are the most random ones.
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0 >> 8) / f64::from(1u32 << 24)
    }

    /// Returns environment and input of sample `k` in a range of inputs: noise, jumps from end to end, rests and slow
    /// sines in turn.
    fn sample<T: Real>(&mut self, k: usize, [low, high]: [f64; 2]) -> (Env<T>, T) {
        let x = match (k / 1000) % 5 {
            0 => self.next(),
            1 => f64::from(u8::from(self.next() > 0.5)),
            2 => 0.37,
            3 => 0.5 - 0.5 * (0.02 * k as f64).cos(),
            _ => (0.5 + 0.4 * (0.3 * k as f64).sin() + 0.1 * self.next()).clamp(0.0, 1.0),
        };
        let t = 1e-3 * (k % 10_000) as f64;
        let env = Env { time: t, temperature: 20.0 + 6.0 * (0.7 * t).sin(), load: 5.0 * (1.3 * t).cos() };
        let env =
            Env { time: T::from_f64(env.time), temperature: T::from_f64(env.temperature), load: T::from_f64(env.load) };
        (env, T::from_f64(low + (high - low) * x))
    }
}

struct Bounded;

impl Visit for Bounded {
    fn visit<C: Case, T: Precision>(&mut self) {
        const SAMPLES: usize = 1_000_000;
        let name = format!("{} {}", C::NAME, T::NAME);
        let model = Box::new(C::build::<T>().unwrap_or_else(|e| panic!("{name}: {e}")));
        let (mut state, mut draw) = (Box::new(model.state()), Draw(7));
        let (env, u) = draw.sample::<T>(0, C::INPUT);
        model.reset(&mut state, &env, u);
        let (mut early, mut late) = (0.0f64, 0.0f64);
        for k in 1..SAMPLES {
            let (env, u) = draw.sample::<T>(k, C::INPUT);
            let y = model.step(&mut state, &env, u).to_f64();
            assert!(y.is_finite(), "{name}: {y} at sample {k}");
            let largest = if k < SAMPLES / 4 { &mut early } else { &mut late };
            *largest = largest.max(y.abs());
        }
        // Linear growth would give up to four times the value of the first quarter.
        assert!(late <= 1.5 * early + 1e-9, "{name}: at most {early} in the first quarter, {late} later");
    }
}

struct Fresh;

impl Visit for Fresh {
    fn visit<C: Case, T: Precision>(&mut self) {
        let name = format!("{} {}", C::NAME, T::NAME);
        let model = Box::new(C::build::<T>().unwrap_or_else(|e| panic!("{name}: {e}")));
        let run = |state: &mut _| {
            let mut draw = Draw(3);
            let (env, u) = draw.sample::<T>(0, C::INPUT);
            let first = model.reset(state, &env, u);
            let rest = (1..3000).map(|k| {
                let (env, u) = draw.sample::<T>(k, C::INPUT);
                model.step(state, &env, u)
            });
            std::iter::once(first).chain(rest).map(Precision::bits).collect::<Vec<u64>>()
        };
        let mut state = Box::new(model.state());
        let fresh = run(&mut state);
        assert!(fresh == run(&mut state), "{name}: a reset does not restore the initial state");
    }
}

#[test]
fn a_reset_restores_the_initial_state() {
    each(&mut Fresh);
}

/// Collects the failures of each case after missed samples.
#[derive(Default)]
struct Dropout {
    failures: Vec<String>,
}

impl Dropout {
    /// Runs two copies of a case: one receives invalid samples, the other the last valid sample again.
    fn compare<C: Case, T: Precision>() -> Result<(), String> {
        let model = Box::new(C::build::<T>().map_err(|e| e.to_string())?);
        let (mut missed, mut repeated) = (Box::new(model.state()), Box::new(model.state()));
        // A stage without state cannot repeat a sample: its output is invalid once.
        let has_state = size_of_val(&*missed) > 0;
        let mut draw = Draw(5);
        let (env, mut last) = (draw.sample::<T>(0, C::INPUT).0, T::ZERO);
        model.reset(&mut missed, &env, T::from_f64(f64::NAN));
        model.reset(&mut repeated, &env, last);
        for k in 1..20_000 {
            let (env, u) = draw.sample::<T>(k, C::INPUT);
            if k == 1 || k % 4000 == 500 {
                for dropped in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let y = model.step(&mut missed, &env, T::from_f64(dropped)).to_f64();
                    let same = model.step(&mut repeated, &env, last).to_f64();
                    if has_state && y.to_bits() != same.to_bits() {
                        return Err(format!("{y} for {dropped} at sample {k}, {same} expected"));
                    }
                }
            }
            let y = model.step(&mut missed, &env, u).to_f64();
            let same = model.step(&mut repeated, &env, u).to_f64();
            if !y.is_finite() || y.to_bits() != same.to_bits() {
                return Err(format!("{y} at sample {k}, {same} expected"));
            }
            last = u;
        }
        // A reset with an invalid sample uses zero, not an earlier sample.
        let env = draw.sample::<T>(0, C::INPUT).0;
        let (mut fresh, zero) = (Box::new(model.state()), T::ZERO);
        let y = model.reset(&mut missed, &env, T::from_f64(f64::NAN)).to_f64();
        let same = model.reset(&mut fresh, &env, zero).to_f64();
        let (later, as_fresh) =
            (model.step(&mut missed, &env, zero).to_f64(), model.step(&mut fresh, &env, zero).to_f64());
        if has_state && (y.to_bits() != same.to_bits() || later.to_bits() != as_fresh.to_bits()) {
            return Err(format!("{y} and {later} after a reset, {same} and {as_fresh} expected"));
        }
        Ok(())
    }
}

impl Visit for Dropout {
    fn visit<C: Case, T: Precision>(&mut self) {
        // These are not models. The limiter stops the drive where it is at an invalid command; the adaptation passes an
        // invalid reference on to the inverse, which repeats its last sample.
        if ["limits", "adaptation"].contains(&C::NAME) {
            return;
        }
        if let Err(what) = Self::compare::<C, T>() {
            self.failures.push(format!("{} {}: {what}", C::NAME, T::NAME));
        }
    }
}

#[test]
fn an_invalid_sample_repeats_the_last_one() {
    let mut dropout = Dropout::default();
    each(&mut dropout);
    assert!(dropout.failures.is_empty(), "{}", dropout.failures.join("\n"));
}

/// Runs an inverse and its model over references of every kind, both from rest. Returns the largest error as a share of
/// the range of the references.
fn largest_error<M: Case, I: Case, T: Precision>() -> f64 {
    let (model, inverse) = (Box::new(M::build::<T>().unwrap()), Box::new(I::build::<T>().unwrap()));
    let (mut s, mut i, mut draw) = (Box::new(model.state()), Box::new(inverse.state()), Draw(9));
    let (env, first) = draw.sample::<T>(0, I::INPUT);
    let mut reached = model.reset(&mut s, &env, inverse.reset(&mut i, &env, first));
    let (mut wanted, mut worst) = (first, 0.0f64);
    for k in 1..20_000 {
        worst = worst.max((reached - wanted).to_f64().abs());
        let env;
        (env, wanted) = draw.sample::<T>(k, I::INPUT);
        reached = model.step(&mut s, &env, inverse.step(&mut i, &env, wanted));
    }
    worst / (I::INPUT[1] - I::INPUT[0])
}

/// Model ∘ inverse in both precisions, including jumps, rests and minor loops. Inverses with preview have separate
/// tests. The inverse of the dynamic Preisach model has separate tests too: its jumps fade out, so it does not reach
/// every reference at once.
#[test]
fn every_causal_inverse_reaches_its_references() {
    macro_rules! pairs {
        ($($model:ident, $inverse:ident: $double:literal, $single:literal;)*) => {$(
            let (double, single) =
                (largest_error::<list::$model, list::$inverse, f64>(), largest_error::<list::$model, list::$inverse, f32>());
            println!("{}: {double:.1e} of span, {single:.1e} in single precision", stringify!($model));
            assert!(double <= $double && single <= $single, "{}: {double} {single}", stringify!($model));
        )*};
    }
    pairs! {
        pi_10, pi_10_inverse: 1e-12, 1e-4;
        pi_10_viscous, pi_10_viscous_inverse: 1e-12, 1e-4;
        pi_10_root_viscous, pi_10_root_viscous_inverse: 1e-12, 1e-4;
        gpi_10, gpi_10_inverse: 1e-12, 1e-4;
        td_pi_9, td_pi_9_inverse: 1e-12, 1e-4;
        everett_24, everett_24_inverse: 1e-12, 1e-4;
        lfdm_24, lfdm_24_inverse: 1e-12, 1e-4;
        ifm_24, ifm_24_inverse: 1e-12, 1e-3;
        bouc_wen, bouc_wen_inverse: 1e-4, 1e-3;
        creep_4, creep_4_inverse: 1e-12, 1e-4;
        asymmetry, asymmetry_inverse: 1e-12, 1e-4;
        saturation, saturation_inverse: 1e-12, 1e-3;
    }
}

/// Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.
mod long {
    use super::*;

    #[test]
    fn output_stays_bounded_over_a_million_samples() {
        each(&mut Bounded);
    }
}
