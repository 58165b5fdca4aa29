//! The Maxwell-slip operator with backlash or elasto-slip elements.

use crate::error::finite;
use crate::{Build, Curve, Envelope, Error, Gpi, Meta, Params, Pi, Real};

/// Type of a Maxwell-slip element with width d and gain g.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum SlipReading {
    /// A backlash of total width d: `g play_{d/2}(u)`. With this type, the published parameters of the
    /// temperature-dependent electromechanical model give the published loops.
    #[default]
    Backlash,
    /// A spring of stiffness g that slips at the deflection d (Goldfarb and Celanovic 1997): `g stop_d(u)`. The bank
    /// saturates when every element slips.
    ElastoSlip,
}

/// Parameters of a bank of Maxwell-slip elements, `y = Σᵢ gᵢ element_{dᵢ}(u)`. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MaxwellSlipParams<L> {
    /// Type of the elements.
    pub reading: SlipReading,
    /// Widths dᵢ \[u\], positive and strictly rising.
    pub widths: L,
    /// Gains gᵢ \[y/u\].
    pub gains: L,
}

impl<L: AsMut<[f64]>> Params for MaxwellSlipParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        for d in self.widths.as_mut() {
            f(&Meta { name: "widths", unit: "u", lower: 0.0, upper: f64::INFINITY }, d);
        }
        for g in self.gains.as_mut() {
            f(&Meta { name: "gains", unit: "y/u", lower: 0.0, upper: f64::INFINITY }, g);
        }
    }
}

/// A bank of at most `N` Maxwell-slip elements. It is a Prandtl-Ishlinskii operator. Elasto-slip elements are stops.
/// With backlash elements the narrowest play is first (an envelope). The others follow it with radii that are smaller
/// by its radius, because `play_r = play_{r−s} ∘ play_s`.
///
/// With backlash elements the inverse is exact, and its drive jumps across the narrowest play at every reversal. With
/// elasto-slip elements there is no inverse, because the bank saturates.
///
/// ```
/// use hyst_core::{Build, Env, MaxwellSlip, MaxwellSlipParams, SlipReading, Stage};
/// let slip = MaxwellSlipParams { reading: SlipReading::Backlash, widths: [8.0, 16.0], gains: [0.3, 0.1] };
/// let bank: MaxwellSlip<f64, 2> = slip.build(&())?;
/// let mut s = bank.state();
/// let y = bank.step(&mut s, &Env::default(), 100.0);
/// assert!((y - (0.3 * 96.0 + 0.1 * 92.0)).abs() < 1e-12);
/// # Ok::<(), hyst_core::Error>(())
/// ```
pub type MaxwellSlip<T, const N: usize> = Gpi<T, N>;

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<MaxwellSlip<T, N>> for MaxwellSlipParams<L> {
    type Context = ();
    fn build(&self, (): &()) -> Result<MaxwellSlip<T, N>, Error> {
        let (widths, gains) = (self.widths.as_ref(), self.gains.as_ref());
        let identity = Envelope::new(Curve::IDENTITY, Curve::IDENTITY)?;
        // The checks of the operator, with the names of this model. Its gain is the first gain, or the sum of the
        // gains.
        let renamed = |e| match e {
            Error::NonFinite("pi.thresholds") => Error::NonFinite("maxwell-slip.widths"),
            Error::NonFinite(_) => Error::NonFinite("maxwell-slip.gains"),
            Error::OutOfRange { must, .. } => Error::OutOfRange { name: "maxwell-slip.widths", must },
            Error::Lengths(_) => Error::Lengths("maxwell-slip.widths and maxwell-slip.gains"),
            Error::Capacity { needed, holds, .. } => Error::Capacity { name: "maxwell-slip elements", needed, holds },
            other => other,
        };
        let checked = |gain: f64, r: &[f64], w: &[f64]| Pi::new(gain, r, w).map_err(renamed);
        let whole: Pi<T, N> = checked(0.0, widths, gains)?;
        if self.reading == SlipReading::ElastoSlip {
            return Ok(Gpi::new(identity, Pi::from_stops(0.0, widths, gains).map_err(renamed)?));
        }
        let (Some((narrowest, wider)), Some((first, others))) = (widths.split_first(), gains.split_first()) else {
            return Ok(Gpi::new(identity, whole));
        };
        let mut radii = [0.0; N];
        for (r, d) in radii.iter_mut().zip(wider) {
            *r = 0.5 * (d - narrowest);
        }
        let side = |offset| Curve::Linear { slope: 1.0, offset };
        let envelope = Envelope::new(side(-0.5 * narrowest), side(0.5 * narrowest))?;
        let plays =
            checked(finite("maxwell-slip.gains", *first)?, radii.get(..wider.len()).unwrap_or_default(), others)?;
        Ok(Gpi::new(envelope, plays))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Env, Invert, Stage, play, stop};
    use proptest::prelude::*;

    const WIDTHS: [f64; 3] = [4.0, 10.0, 25.0];
    const GAINS: [f64; 3] = [0.3, 0.1, 0.05];

    fn drive(k: u32) -> f64 {
        60.0 * libm::sin(0.11 * f64::from(k)) * libm::sin(0.007 * f64::from(k) + 0.4)
    }

    #[test]
    fn both_types_equal_a_sum_of_their_elements() {
        for reading in [SlipReading::Backlash, SlipReading::ElastoSlip] {
            let bank: MaxwellSlip<f64, 3> =
                MaxwellSlipParams { reading, widths: WIDTHS, gains: GAINS }.build(&()).unwrap();
            let (mut s, e) = (bank.state(), Env::default());
            let (mut elements, mut last) = ([0.0; 3], 0.0);
            for k in 0..2000 {
                let u = drive(k);
                let mut expected = 0.0;
                for ((x, d), g) in elements.iter_mut().zip(WIDTHS).zip(GAINS) {
                    *x = match reading {
                        SlipReading::Backlash => play(*x, u, 0.5 * d),
                        SlipReading::ElastoSlip => stop(*x, u - last, d),
                    };
                    expected += g * *x;
                }
                last = u;
                assert!((bank.step(&mut s, &e, u) - expected).abs() < 1e-11, "{reading:?} {k}");
            }
        }
    }

    #[test]
    fn backlash_bank_has_an_exact_inverse_and_elasto_slip_bank_has_none() {
        let of = |reading| -> MaxwellSlip<f64, 3> {
            MaxwellSlipParams { reading, widths: WIDTHS, gains: GAINS }.build(&()).unwrap()
        };
        let bank = of(SlipReading::Backlash);
        let inverse = bank.invert().unwrap();
        let (mut a, mut b, e) = (bank.state(), inverse.state(), Env::default());
        for k in 0..2000 {
            let reference = 0.4 * drive(k);
            let u = inverse.step(&mut b, &e, reference);
            assert!((bank.step(&mut a, &e, u) - reference).abs() < 1e-12 * 48.0);
        }
        assert!(matches!(of(SlipReading::ElastoSlip).invert(), Err(Error::NotInvertible(_))));
    }

    proptest! {
        #[test]
        fn inverse_reaches_every_reference(
            steps in prop::collection::vec((0.1..10.0f64, 0.01..1.0f64), 8),
            references in prop::collection::vec(-40.0..40.0f64, 20..200),
        ) {
            let (mut widths, mut gains, mut at) = ([0.0; 8], [0.0; 8], 0.0);
            for ((d, g), (step, gain)) in widths.iter_mut().zip(&mut gains).zip(&steps) {
                at += step;
                (*d, *g) = (at, *gain);
            }
            let bank: MaxwellSlip<f64, 8> =
                MaxwellSlipParams { reading: SlipReading::Backlash, widths, gains }.build(&()).unwrap();
            let inverse = bank.invert().unwrap();
            let (mut a, mut b, e) = (bank.state(), inverse.state(), Env::default());
            for y in &references {
                let u = inverse.step(&mut b, &e, *y);
                prop_assert!((bank.step(&mut a, &e, u) - y).abs() <= 1e-12 * 80.0 * (1.0 + 1.0 / gains[0]));
            }
        }
    }

    #[test]
    fn errors_use_the_names_of_this_model() {
        for reading in [SlipReading::Backlash, SlipReading::ElastoSlip] {
            let rejected = |widths: &[f64], gains: &[f64]| {
                let built: Result<MaxwellSlip<f64, 2>, _> = MaxwellSlipParams { reading, widths, gains }.build(&());
                built.unwrap_err()
            };
            let gains = Error::NonFinite("maxwell-slip.gains");
            assert!(matches!(rejected(&[4.0, 3.0], &[1.0; 2]), Error::OutOfRange { name: "maxwell-slip.widths", .. }));
            assert_eq!(rejected(&[4.0, f64::NAN], &[1.0; 2]), Error::NonFinite("maxwell-slip.widths"));
            assert_eq!(rejected(&[4.0, 5.0], &[f64::NAN, 1.0]), gains);
            assert_eq!(rejected(&[4.0, 5.0], &[1.0]), Error::Lengths("maxwell-slip.widths and maxwell-slip.gains"));
            assert!(matches!(
                rejected(&[4.0, 5.0, 6.0], &[1.0; 3]),
                Error::Capacity { name: "maxwell-slip elements", .. }
            ));
            // Each gain is finite, but their sum overflows.
            if reading == SlipReading::ElastoSlip {
                assert_eq!(rejected(&[4.0, 5.0], &[f64::MAX; 2]), gains);
            }
        }
    }
}
