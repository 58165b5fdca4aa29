//! The bytes of a controller that a device can run.

use hyst_core::{ChainParams, EffectParams, ForceParams, LagParams, OperatorParams, PiParams, PidParams, write_block};
use hyst_hw::wire::recipe_head;

/// Returns the head of a controller and the block of its model: play operators with a gain \[µm/V\] and a lag of 3 ms
/// in a range \[V\], a PID and a force observer.
///
/// # Panics
/// Never: the buffer is large enough.
pub fn controller(gain: f64, plays: u32, range: [f64; 2]) -> [Vec<u8>; 2] {
    let operator = OperatorParams::Pi(PiParams {
        gain,
        thresholds: (0..plays).map(|i| 1.5 + 4.0 * f64::from(i)).collect(),
        weights: (0..plays).map(|i| 0.022 * (-0.25 * f64::from(i)).exp()).collect(),
    });
    let effects = EffectParams { lag: Some(LagParams { seconds: 0.003 }), ..EffectParams::default() };
    let model: ChainParams<Vec<f64>> = ChainParams { operator, effects, falls: false, zero: 0.0, input: range };
    let pid = PidParams {
        proportional: 0.5,
        integral: 60.0,
        derivative: 0.0,
        derivative_hz: 50.0,
        proportional_weight: 1.0,
        derivative_weight: 0.0,
        anti_windup_seconds: 0.05,
        low: range[0],
        high: range[1],
    };
    let force = ForceParams { stiffness: 1.5, kappa: 1.0, chi: 0.0 };
    let block = write_block(&model, &mut [0; 4096]).expect("the buffer is large enough").to_vec();
    [recipe_head(Some(&pid), Some(&force)).to_vec(), block]
}
