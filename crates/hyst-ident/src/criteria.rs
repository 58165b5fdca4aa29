//! Thresholds of the decisions: when errors are equal, better, or above the noise, and the plausible range of each
//! effect of a piezo actuator.
//!
//! Comparisons use a few ratios and shares. They were chosen on simulated actuators of seven hysteresis laws
//! (`tests/src/other_physics.rs`) and on examinations one to six of `tests/examination`. Thresholds of a single
//! question (the colour of a noise, a tone of the sensor), and settings that only affect the computing time (rows,
//! grids, rounds), are next to their use.

// Ratios of two errors (RMSE).

/// Maximum ratio of two errors that count as equal: a second fit to the same rows may differ by this much.
pub(crate) const RMSE_TOLERANCE: f64 = 1.05;
/// Minimum relative fall of an error that counts: another draw of the blocks changes an error by some per cent.
pub(crate) const MIN_RMSE_DROP: f64 = 0.1;
/// Minimum ratio of two errors that differ clearly, even if only a few parts of the record show it. An explanation of a
/// misfit in other terms may be worse by this ratio.
pub(crate) const MIN_RMSE_RATIO: f64 = 1.3;
/// Ratio of errors, peaks or noise floors above which the smaller one does not matter.
pub(crate) const LARGE_RATIO: f64 = 3.0;
/// Minimum ratio by which a drive history has to lower the error of the first rows. Another effect or a sensor
/// transient lowers it less.
pub(crate) const MIN_PAST_RATIO: f64 = 2.0;

// Shares of a variance, a range or a number of rows.

/// Maximum negligible share: no law is exact to one per cent.
pub(crate) const NEGLIGIBLE_SHARE: f64 = 0.01;
/// Minimum share that an effect of the motion has to explain, relative to the slew limit of an amplifier that was found
/// with it: the slew limit is far larger than any effect.
pub(crate) const MIN_SHARE_BESIDE_SLEW_LIMIT: f64 = 1e-3;
/// Maximum share of a minor part.
pub(crate) const MINOR_SHARE: f64 = 0.1;
/// Minimum share of the variance above the noise floor that an effect has to explain.
pub(crate) const MIN_VARIANCE_SHARE: f64 = 0.3;
/// Minimum share of the larger part.
pub(crate) const HALF: f64 = 0.5;
/// Minimum share of the dominant part; nothing else of that size can be missing.
pub(crate) const DOMINANT_SHARE: f64 = 0.9;

/// Accuracy of a hysteresis model of another law than the actuator's, as a share of the hysteresis (RMS): 16 play
/// operators or 120 relays, fitted to clean records of twelve laws, leave 0.2 to 3 % of it.
pub(crate) const LAW_ACCURACY: f64 = 0.03;

// Sizes in noise floors (RMS).

/// Minimum RMS of an effect's contribution.
pub(crate) const MIN_NOISE_FLOORS: f64 = 0.5;

// Evidence.

/// Minimum share of bootstrap draws in which an effect does not increase the error.
pub(crate) const MIN_CONFIDENCE: f64 = 0.99;
/// Minimum share of bootstrap draws in which a set is better, to be clearly better.
pub(crate) const MIN_BETTER_DRAWS: f64 = 0.95;
/// Minimum number of standard errors between a parameter and the value at which its effect vanishes (95 % of a normal
/// distribution).
pub(crate) const MIN_STD_ERRORS: f64 = 2.0;

// Plausible ranges of effects.

/// Lowest frequency of a sensor tone and of a structural mode \[Hz\]: no structure of a piezo actuator's size is slower,
/// and a slower oscillation of a sensor may be a force or the room temperature.
pub(crate) const MIN_OSCILLATION_HZ: f64 = 2.0;
/// Largest damping ratio of a resonance: a larger one does not ring.
pub(crate) const MAX_MODE_DAMPING: f64 = 0.35;
/// Minimum time constant of a drift, in durations of the record: a faster one may be a start-up transient.
pub(crate) const MIN_DRIFT_TIME: f64 = 0.04;
/// Maximum jump of a zero beside its drift, as a share of its whole way: a zero that moves in steps indicates a slipping
/// mount.
pub(crate) const MAX_ZERO_STEP: f64 = 0.1;
/// Minimum difference between the bends of a curve's two halves, as a share of the bend (power): equal bends are a
/// symmetric loop.
pub(crate) const MIN_BEND_DIFFERENCE: f64 = 0.25;
/// Maximum knee width of a saturation on a base that bends by itself, as a share of the range between its limits. On
/// other bases it may be soft throughout.
pub(crate) const MAX_SHARP_KNEE: f64 = 0.2;
/// Maximum distance from a limit at which an output counts as saturated, as a share of the motion's span.
pub(crate) const MAX_STOP_DISTANCE: f64 = 0.05;
/// Minimum share of saturated rows.
pub(crate) const MIN_STOP_ROWS: f64 = 0.003;
