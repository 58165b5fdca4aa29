//! The thresholds that decisions share: what counts as alike, as better, as nearly all of something, as above the noise, and what an effect of a piezo
//! actuator can be.
//!
//! Comparisons use a few ratios and shares. They were chosen on simulated actuators of seven hysteresis laws
//! (`tests/src/other_physics.rs`) and on the examinations one to six of `tests/examination`. What belongs to one question (the
//! colour of a noise, a tone of the sensor) and settings that only cost or save time (rows, grids, rounds) are where they are used.

// Ratios of two errors (RMSE).

/// Up to this ratio an error is not larger than another: a second fit to the same rows may differ by as much.
pub(crate) const RMSE_TOLERANCE: f64 = 1.05;
/// Relative fall of an error from which on it is smaller: another draw of the blocks changes one by some per cent.
pub(crate) const MIN_RMSE_DROP: f64 = 0.1;
/// Ratio from which on one error is far larger than another, however few parts of the record show it. What explains a misfit in other terms may be worse
/// by this ratio.
pub(crate) const MIN_RMSE_RATIO: f64 = 1.3;
/// Ratio of errors, peaks or noise floors from which on the smaller one does not matter.
pub(crate) const LARGE_RATIO: f64 = 3.0;
/// Fall of the error of the first rows from which on a past of the drive explains it: another effect, or a transient of the sensor, explains less.
pub(crate) const MIN_PAST_RATIO: f64 = 2.0;

// Shares of a variance, a range or a number of rows.

/// At most this share is next to nothing: no law is exact to a hundredth.
pub(crate) const NEGLIGIBLE_SHARE: f64 = 0.01;
/// Share of what a slow amplifier explains that an effect of the motion has to explain beside it: the amplifier's part is far larger than any effect.
pub(crate) const MIN_SHARE_BESIDE_SLEW_LIMIT: f64 = 1e-3;
/// At most this share is a small part.
pub(crate) const MINOR_SHARE: f64 = 0.1;
/// Share of the variance above the noise floor that an effect has to explain.
pub(crate) const MIN_VARIANCE_SHARE: f64 = 0.3;
/// From this share on it is the larger part.
pub(crate) const HALF: f64 = 0.5;
/// From this share on it is the main part, and nothing else of that size can be missing.
pub(crate) const DOMINANT_SHARE: f64 = 0.9;
/// From this share on it is the whole.
pub(crate) const WHOLE_SHARE: f64 = 0.98;

/// Share of the hysteresis (RMS) that a model of another law than the actuator's may miss: 16 plays or 120 relays, fitted to clean records of twelve
/// laws, miss 0.2 to 3 % of it.
pub(crate) const LAW_ACCURACY: f64 = 0.03;

// Heights in noise floors (RMS).

/// What an effect has to add.
pub(crate) const MIN_NOISE_FLOORS: f64 = 0.5;
/// An error up to this height is near the noise.
pub(crate) const MAX_NOISE_FLOORS: f64 = 1.5;

// Evidence.

/// Share of bootstrap draws in which an effect must not lose.
pub(crate) const MIN_CONFIDENCE: f64 = 0.99;
/// Share of bootstrap draws in which a set has to be better to be clearly better.
pub(crate) const MIN_BETTER_DRAWS: f64 = 0.95;
/// Standard errors by which a parameter has to differ from the value at which its effect vanishes (95 % of a normal distribution).
pub(crate) const MIN_STD_ERRORS: f64 = 2.0;

// What an effect can be.

/// Slowest tone of a sensor \[Hz\]: what swings more slowly may as well be a force or the room.
pub(crate) const MIN_TONE_HZ: f64 = 2.0;
/// Slowest structural mode \[Hz\]: what moves by itself in seconds is no structure of a piezo's size.
pub(crate) const MIN_MODE_HZ: f64 = 1.0;
/// Largest damping ratio of a resonance: beyond it nothing rings.
pub(crate) const MAX_MODE_DAMPING: f64 = 0.35;
/// Time constant of a drift, in durations of the record: what is over sooner may be how the record began.
pub(crate) const MIN_DRIFT_TIME: f64 = 0.04;
/// Largest share of its whole way that a zero that drifts makes at once: what goes in steps is a mount that slips.
pub(crate) const MAX_ZERO_STEP: f64 = 0.25;
/// Share of a curve's bend (power) that has to differ between its two halves: one that bends both alike is a symmetric loop.
pub(crate) const MIN_BEND_DIFFERENCE: f64 = 0.25;
/// Largest width of the knee of a stop on a base that bends by itself, as a share of the range between its limits.
pub(crate) const MAX_SHARP_KNEE: f64 = 0.2;
/// The same on a base that does not bend.
pub(crate) const MAX_KNEE: f64 = 0.45;
/// Distance from a limit within which an output is at a stop, as a share of the motion's span.
pub(crate) const MAX_STOP_DISTANCE: f64 = 0.05;
/// Share of the rows that have to be at a stop.
pub(crate) const MIN_STOP_ROWS: f64 = 0.003;
