//! The list of all cases.
//!
//! To add a model, add a line here and a constant with its parameters to `models.rs`.

use crate::models::*;
use crate::{Case, PERIOD, Visit, given};
use hyst_core::*;

/// Calls `$with!` with all cases.
///
/// A case is a name, a type of coefficients in precision `T`, a range of the input, and an expression that builds the
/// coefficients.
#[macro_export]
macro_rules! all_cases {
    ($with:ident) => {
        $with! {
            pi_10: Pi<T, 10>, 0.0..120.0 => pi::<T, 10>();
            pi_10_inverse: Pi<T, 10>, 0.0..20.0 => pi::<T, 10>()?.invert();
            pi_16: Pi<T, 16>, 0.0..120.0 => pi::<T, 16>();
            pi_10_viscous: ViscousPi<T, 10>, 0.0..120.0 => viscous::<T>();
            pi_10_viscous_inverse: ViscousPiInverse<T, 10>, 0.0..20.0 => viscous::<T>()?.invert();
            pi_10_root_viscous: ViscousPi<T, 10>, 0.0..120.0 => root_viscous::<T>();
            pi_10_root_viscous_inverse: ViscousPiInverse<T, 10>, 0.0..20.0 => root_viscous::<T>()?.invert();
            gpi_10: Gpi<T, 10>, 0.0..120.0 => gpi::<T>();
            gpi_10_inverse: GpiInverse<T, 10>, 0.0..20.0 => gpi::<T>()?.invert();
            td_pi_9: TdPi<T, 9>, -200.0..200.0 => given(TdPiParams::PRINTED).build(&());
            td_pi_9_inverse: TdPiInverse<T, 9>, -30.0..30.0 => Build::<TdPi<T, 9>>::build(&given(TdPiParams::PRINTED), &())?.invert();
            maxwell_slip_10: MaxwellSlip<T, 10>, -200.0..200.0 => given(TdEmParams::PRINTED.slip).build(&());
            td_em_10: TdEm<T, 10>, -200.0..200.0 => given(TdEmParams::PRINTED).build(&PERIOD);
            td_em_10_steady: Steady<TdEm<T, 10>>, -200.0..200.0 => Ok(Steady(given(TdEmParams::PRINTED).build(&PERIOD)?));
            td_em_10_inverse: TdEmInverse<T, 10, 129>, -30.0..30.0 => Build::<TdEm<T, 10>>::build(&given(TdEmParams::PRINTED), &PERIOD)?.band_limited(23.0, None);
            everett_24: Everett<T, 25>, -5.0..125.0 => everett::<T, 25>();
            everett_24_inverse: EverettInverse<T, 25>, 0.0..20.0 => everett::<T, 25>()?.invert();
            lfdm_24: Lfdm<T, Exponentials<T, 24>>, 0.0..120.0 => given(LFDM).build(&PERIOD);
            lfdm_24_inverse: Lfdm<T, Exponentials<T, 24>>, 0.0..20.0 => Build::<Lfdm<T, Exponentials<T, 24>>>::build(&given(LFDM), &PERIOD)?.invert();
            lfdm_short_100: Lfdm<T, ShortMemory<T, 100>>, 0.0..120.0 => given(LFDM).build(&PERIOD);
            ifm_24: Ifm<T, Exponentials<T, 24>, 32>, 0.0..120.0 => given(IFM).build(&PERIOD);
            ifm_24_inverse: IfmInverse<T, Exponentials<T, 24>, 32>, 0.0..20.0 => Build::<Ifm<T, Exponentials<T, 24>, 32>>::build(&given(IFM), &PERIOD)?.invert();
            dpm_24: Dpm<T, 25, 8, 9>, -5.0..125.0 => dpm::<T>();
            dpm_24_inverse: Search<T, Dpm<T, 25, 8, 9>>, 0.0..15.0 => Search::new(dpm::<T>()?, -100.0, 220.0, 1e-4);
            bouc_wen: BoucWen<T>, 0.0..120.0 => given(BOUC_WEN).build(&());
            bouc_wen_n2: BoucWen<T>, 0.0..120.0 => given(BoucWenParams { n: 2.0, ..BOUC_WEN }).build(&());
            bouc_wen_inverse: Search<T, BoucWen<T>>, 0.0..20.0 => Build::<BoucWen<T>>::build(&given(BOUC_WEN), &())?.inverse(-50.0, 250.0, 1e-4);
            bouc_wen_oscillator: BoucWenOscillator<T>, -120.0..120.0 => given(BoucWenOscillatorParams::BENCHMARK).build(&PERIOD);
            atan: Activation<T>, 0.0..40.0 => given((ActivationKind::Atan, XIE)).build(&PERIOD);
            sigmoid: Activation<T>, 0.0..40.0 => given((ActivationKind::Sigmoid, XIE)).build(&PERIOD);
            softplus: Activation<T>, 0.0..40.0 => given((ActivationKind::Softplus, XIE)).build(&PERIOD);
            softsign: Activation<T>, 0.0..40.0 => given((ActivationKind::Softsign, XIE)).build(&PERIOD);
            tanh: Activation<T>, 0.0..40.0 => given((ActivationKind::Tanh, XIE)).build(&PERIOD);
            tanh_inverse: ActivationInverse<T>, 0.0..6.0 => Build::<Activation<T>>::build(&given((ActivationKind::Tanh, ActivationParams { alpha: 1e-4, ..XIE })), &PERIOD)?.invert();
            tanh_anti_causal: AntiCausal<T, 64>, 0.0..6.0 => Build::<Activation<T>>::build(&given((ActivationKind::Tanh, XIE)), &PERIOD)?.anti_causal(1e-3);
            delay: Delay<T, 16>, 0.0..120.0 => given(DELAY).build(&PERIOD);
            lag: Lag<T>, 0.0..120.0 => given(LAG).build(&PERIOD);
            rate: Rate<T>, 0.0..120.0 => given(OVERDRIVE).build(&PERIOD);
            rate_inverse: RateInverse<T>, 0.0..120.0 => Build::<Rate<T>>::build(&given(OVERDRIVE), &PERIOD)?.invert();
            widening_6: Widening<T>, 0.0..120.0 => given(WIDENING).build(&PERIOD);
            creep_4: Creep<T, 4>, 0.0..20.0 => given(CREEP).build(&PERIOD);
            creep_4_inverse: CreepInverse<T, 4>, 0.0..20.0 => Build::<Creep<T, 4>>::build(&given(CREEP), &PERIOD)?.invert();
            resonance: Resonance<T>, 0.0..20.0 => given(MODE).build(&PERIOD);
            temperature: Temperature<T>, 0.0..20.0 => given(TEMPERATURE).build(&PERIOD);
            asymmetry: Asymmetry<T, MAX_DEAD_ZONES>, -20.0..20.0 => given(ASYMMETRY).build(&());
            asymmetry_inverse: AsymmetryInverse<T, MAX_DEAD_ZONES>, -20.0..20.0 => Build::<Asymmetry<T, MAX_DEAD_ZONES>>::build(&given(ASYMMETRY), &())?.invert();
            load: Load<T>, 0.0..20.0 => given(COMPLIANCE).build(&());
            saturation: Saturation<T>, -5.0..25.0 => given(SATURATION).build(&());
            saturation_inverse: SaturationInverse<T>, -1.0..19.0 => Build::<Saturation<T>>::build(&given(SATURATION), &())?.invert();
            drift: Drift<T>, 0.0..20.0 => given(DRIFT).build(&());
            interference: Interference<T>, 0.0..20.0 => given(INTERFERENCE).build(&());
            chain: Chain<T, Pi<T, 10>, 16, 4>, 0.0..120.0 => chain::<T>();
            compensator: Compensator<T, Pi<T, 10>, 16, 4, 129>, 0.0..20.0 => chain::<T>()?.compensator(&PERIOD, &OPTIONS);
            pid: Loop<T>, 0.0..20.0 => pid_loop::<T>();
            force_observer: Observer<T>, 0.0..120.0 => observer::<T>();
            adaptation: Adaptive<T>, 0.0..20.0 => adaptive::<T>();
            limits: Limiter<T>, -20.0..140.0 => limiter::<T>();
        }
    };
}

macro_rules! define {
    ($($name:ident: $model:ty, $low:literal..$high:literal => $build:expr;)*) => {
        $(
            #[doc = concat!("The case `", stringify!($name), "`.")]
            #[allow(non_camel_case_types, reason = "a case has the name of its line")]
            #[derive(Debug)]
            pub enum $name {}

            impl Case for $name {
                const NAME: &'static str = stringify!($name);
                const INPUT: [f64; 2] = [$low, $high];
                type Model<T: Real> = $model;
                fn build<T: Real>() -> Result<Self::Model<T>, Error> {
                    $build
                }
            }
        )*

        pub(crate) fn each(visitor: &mut impl Visit) {
            $(
                visitor.visit::<$name, f32>();
                visitor.visit::<$name, f64>();
            )*
        }
    };
}

all_cases!(define);
