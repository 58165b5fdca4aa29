//! The list of all cases: to add a model is to add a line here, and a constant to `models.rs` for its parameters.

use crate::models::*;
use crate::{Case, PERIOD, Visit, given};
use hyst_core::*;

/// Calls `$with!` with every case: name, coefficients in precision `T`, range of the input, how they are built.
#[macro_export]
macro_rules! all_cases {
    ($with:ident) => {
        $with! {
            pi_10: Pi<T, 10>, 0.0..120.0 => pi::<T, 10>();
            pi_10_inverse: Pi<T, 10>, 0.0..20.0 => pi::<T, 10>()?.invert();
            pi_16: Pi<T, 16>, 0.0..120.0 => pi::<T, 16>();
            everett_24: Everett<T, 25>, -5.0..125.0 => everett::<T, 25>();
            everett_24_inverse: EverettInverse<T, 25>, 0.0..20.0 => everett::<T, 25>()?.invert();
            delay: Delay<T, 16>, 0.0..120.0 => given(DEAD_TIME).build(&PERIOD);
            lag: Lag<T>, 0.0..120.0 => given(LAG).build(&PERIOD);
            creep_4: Creep<T, 4>, 0.0..20.0 => given(CREEP).build(&PERIOD);
            creep_4_inverse: CreepInverse<T, 4>, 0.0..20.0 => Build::<Creep<T, 4>>::build(&given(CREEP), &PERIOD)?.invert();
            resonance: Resonance<T>, 0.0..20.0 => given(MODE).build(&PERIOD);
            temperature: Temperature<T>, 0.0..20.0 => given(WARMTH).build(&());
            drift: Drift<T>, 0.0..20.0 => given(DRIFT).build(&());
            interference: Interference<T>, 0.0..20.0 => given(MAINS).build(&());
            chain: Chain<T, Pi<T, 10>, 16, 4>, 0.0..120.0 => chain::<T>();
            compensator: Compensator<T, Pi<T, 10>, 16, 4, 129>, 0.0..20.0 => chain::<T>()?.compensator(&PERIOD, &OPTIONS);
            limits: Limiter<T>, -20.0..140.0 => limiter::<T>();
        }
    };
}

macro_rules! define {
    ($($name:ident: $model:ty, $low:literal..$high:literal => $build:expr;)*) => {
        $(
            #[doc = concat!("The case `", stringify!($name), "`.")]
            #[allow(non_camel_case_types, reason = "a case is called as its line is")]
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
