//! The job of a run: a drive that is played unchanged, or a reference to follow with a model.

use std::net::SocketAddr;
use std::path::Path;

use hyst_core::{ForceParams, PidParams};
use hyst_hw::wire::{SATURATION_TOLERANCE, lateness, recipe_head};
use hyst_hw::{Capabilities, RecordOptions, Recording};
use hyst_ident::compensate::{CompensateOptions, Drive, compensate};
use hyst_ident::export::block;
use hyst_ident::loop_gains;
use hyst_ident::model::Model;
use hyst_ident::record::{Need, Record};

use super::adapt::Adapting;
use super::control::ClosedLoop;
use super::live::Live;
use super::parallel::{Force, ParallelModel};
use super::shape::Shape;
use crate::cli::{Control, PidGains, RecordArgs, RunArgs, VoltageLimits};
use crate::commands::compensate::{Compensation, options};
use crate::exit::{CommandError, CommandResult};
use crate::output::say;
use crate::{input, recording, text};

/// Everything that is needed before a device moves.
#[derive(Debug)]
pub(in crate::commands) struct Job {
    /// Voltages of each segment \[V\].
    pub(in crate::commands) segments: Vec<Vec<f64>>,
    /// How the segments are played.
    pub(in crate::commands) options: RecordOptions,
    /// Reference and model; `None` for a drive that is played unchanged.
    pub(in crate::commands) followed: Option<Followed>,
    /// Wanted output at each voltage; `None` for a drive.
    pub(in crate::commands) wanted: Vec<Option<f64>>,
    /// Controller on the device; with it `segments` holds references \[output unit\].
    pub(super) handed_over: Option<HandedOver>,
    /// Symbol of the output unit.
    pub(super) symbol: &'static str,
    /// Whether a record is written.
    pub(super) recorded: bool,
    /// Name of the option for a log, for messages.
    pub(in crate::commands) log_option: &'static str,
    /// Address for viewers.
    pub(super) live: Option<SocketAddr>,
    /// Whether a progress bar is shown instead of a plot.
    pub(super) plain: bool,
    /// Maximum temperature \[°C\] and maximum tracking error \[output unit\] of the run.
    pub(super) hottest_degc: Option<f64>,
    pub(super) greatest_error: Option<f64>,
    /// Temperature if none is measured \[°C\], and stiffness for a force estimate \[N/output unit\].
    degc: Option<f64>,
    stiffness: Option<f64>,
}

/// A controller that runs on the device.
#[derive(Debug)]
pub(super) struct HandedOver {
    /// The controller in the format of the device.
    pub(super) recipe: Vec<u8>,
    /// Minimum and maximum reference \[output unit\].
    pub(super) range: (f64, f64),
    /// Delay of the output relative to the references \[rows\].
    pub(super) late: usize,
    gains: PidParams,
    why: String,
    slew_v_per_s: f64,
    /// Drive of the model's inverse, if it could be computed; the drive of the loop is close to it.
    plan: Option<Drive>,
}

impl HandedOver {
    /// Returns the share of the rows with the drive at a limit and a tracking error \[%\].
    fn limited_percent(&self, recording: &Recording, followed: &Followed) -> f64 {
        let PidParams { low, high, .. } = self.gains;
        // The device computes with f32.
        let (near, step) = (1e-5 * (high - low), 0.999 * self.slew_v_per_s / recording.rate_hz);
        let tolerance = SATURATION_TOLERANCE * (followed.model.output.high - followed.model.output.low);
        let wanted = followed.wanted();
        let (mut held, mut rows) = (0, 0);
        for segment in &recording.segments {
            for (k, sample) in segment.samples.iter().enumerate() {
                let before = k.checked_sub(1).map_or(sample.drive_v, |k| segment.samples[k].drive_v);
                let at_end = sample.drive_v <= low + near || sample.drive_v >= high - near;
                let away = wanted.get(rows).is_some_and(|wanted| (sample.output - wanted).abs() > tolerance);
                held += usize::from(away && (at_end || (sample.drive_v - before).abs() >= step));
                rows += 1;
            }
        }
        100.0 * held as f64 / rows.max(1) as f64
    }
}

/// A reference and the model that computes its drive.
#[derive(Debug)]
pub(in crate::commands) struct Followed {
    pub(in crate::commands) model: Model,
    /// Text of the model file.
    pub(in crate::commands) json: String,
    pub(in crate::commands) reference: Record,
    /// Limits and temperature of the drive.
    pub(in crate::commands) options: CompensateOptions,
    /// Controller that computes the drive.
    pub(super) control: Control,
    /// Drive planned by the model's inverse; `None` without an inverse.
    pub(super) drive: Option<Drive>,
    /// Drive that is corrected during the run, for a measured temperature or an adapted model.
    pub(in crate::commands) live: Option<Live>,
    /// The adaptation of `--adapt`.
    pub(super) adapting: Option<Adapting>,
    /// PID on this computer.
    pub(super) closed: Option<Closed>,
    /// Hold time at the first value of a segment \[s\].
    held_s: f64,
}

/// A PID with its gains and their reason.
#[derive(Debug)]
pub(super) struct Closed {
    pub(super) running: ClosedLoop,
    pub(super) gains: PidParams,
    /// Crossover frequency of gains from the model \[Hz\].
    pub(super) crossover_hz: Option<f64>,
    /// Reason for the gains.
    pub(super) why: String,
}

impl Job {
    /// Creates the model that runs in parallel with the device; `None` without a reference.
    pub(super) fn parallel_model(&self) -> CommandResult<Option<ParallelModel>> {
        let Some(followed) = &self.followed else { return Ok(None) };
        let on_device = self.handed_over.is_some();
        let force = self.stiffness.map(|stiffness| if on_device { Force::OnDevice } else { Force::Here(stiffness) });
        let model =
            ParallelModel::new(&followed.model, self.options.rate_hz, self.degc, force, followed.adapting.clone())?;
        if model.is_none() && self.stiffness.is_some() && !on_device {
            return Err(CommandError::bad_input(
                "--kout needs a model that runs sample by sample, but a model with a band-limited drive between samples needs \
                 the whole drive; estimate the force after the run with hystctl force",
            ));
        }
        Ok(model)
    }

    /// Returns the slope that the device must allow \[V/s\].
    pub(in crate::commands) fn steepest(&self) -> f64 {
        if let Some(HandedOver { slew_v_per_s, .. }) = self.handed_over {
            return slew_v_per_s;
        }
        let steep = |volts: &[f64]| steepest_step(volts) * self.options.rate_hz;
        let steepest = self.segments.iter().map(|volts| steep(volts)).fold(0.0, f64::max);
        SLEW_MARGIN * steepest.max(self.options.slew_v_per_s)
    }

    /// Returns a sentence about the predicted tracking error of the planned drive, if it is large.
    pub(in crate::commands) fn predicted_error(&self) -> Option<String> {
        let followed = self.followed.as_ref()?;
        let plan = self.handed_over.as_ref().and_then(|handed| handed.plan.as_ref());
        followed.predicted_error(followed.drive.as_ref().or(plan)?)
    }

    /// Removes the rows (and forces) before the output has reached the start of a reference.
    pub(super) fn align(&self, recording: &mut Recording, forces: &mut [Vec<f64>]) {
        let Some(HandedOver { late, .. }) = self.handed_over else { return };
        for segment in &mut recording.segments {
            segment.samples.drain(..late.min(segment.samples.len()));
        }
        for forces in forces {
            forces.drain(..late.min(forces.len()));
        }
    }

    /// Returns the PID of the run; `None` without one.
    pub(super) fn pid(&self, recording: &Recording) -> Option<PidReport<'_>> {
        if let (Some(handed), Some(followed)) = (&self.handed_over, &self.followed) {
            let limited_percent = Some(handed.limited_percent(recording, followed));
            return Some(PidReport { gains: &handed.gains, why: &handed.why, crossover_hz: None, limited_percent });
        }
        let Closed { running, gains, crossover_hz, why } = self.followed.as_ref()?.closed.as_ref()?;
        let limited_percent = Some(running.limited_percent());
        Some(PidReport { gains, why, crossover_hz: *crossover_hz, limited_percent })
    }
}

/// Gains and result of a PID.
#[derive(Clone, Copy, Debug)]
pub(super) struct PidReport<'a> {
    pub(super) gains: &'a PidParams,
    /// Reason for the gains.
    pub(super) why: &'a str,
    /// Crossover frequency of gains from the model \[Hz\].
    pub(super) crossover_hz: Option<f64>,
    /// Share of the samples with the drive at a limit \[%\].
    pub(super) limited_percent: Option<f64>,
}

impl Followed {
    /// Returns the wanted output of all segments.
    pub(super) fn wanted(&self) -> &[f64] {
        self.reference.output().unwrap_or_default()
    }

    /// Returns a sentence about the predicted tracking error of a drive and its causes, if it is large.
    fn predicted_error(&self, drive: &Drive) -> Option<String> {
        let Drive { bandwidth_hz, voltage_limited, slew_limited, missed, .. } = drive;
        let wanted = self.wanted();
        let count = wanted.len().max(1) as f64;
        let mean = wanted.iter().sum::<f64>() / count;
        let spread = (wanted.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt();
        let (low, high) = (self.model.output.low, self.model.output.high);
        if missed.settled_rmse <= (MIN_ERROR_SHARE * spread).max(MIN_ERROR_SHARE_OF_RANGE * (high - low)) {
            return None;
        }
        let mut why = Vec::new();
        for (rows, what) in [(voltage_limited, "voltage"), (slew_limited, "slew")] {
            if !rows.is_empty() {
                why.push(format!("the {what} is limited in {} of {}", rows.len(), text::count(wanted.len(), "row")));
            }
        }
        if let (Some(hz), true) = (bandwidth_hz, why.is_empty()) {
            why.push(format!("dynamics are inverted only up to {} Hz", text::short(*hz)));
        }
        let unit = text::symbol(&self.model.output.unit);
        let (missed, why) = (text::short(missed.settled_rmse), why.join(", "));
        let why = if why.is_empty() { String::new() } else { format!(" ({why})") };
        Some(format!("for the planned drive the model predicts a tracking error of {missed} {unit} RMS{why}"))
    }

    /// Returns the wanted output at each row of a recording, whose segments may have ended early.
    pub(super) fn wanted_at(&self, recording: &Recording) -> Vec<f64> {
        let wanted = self.wanted();
        let rows = self.reference.segments().iter().zip(&recording.segments);
        rows.flat_map(|(rows, segment)| wanted[rows.clone()].iter().take(segment.samples.len())).copied().collect()
    }

    /// Whether the drive is corrected during the run and depends on the temperature.
    pub(super) fn needs_temperature(&self) -> bool {
        self.live.is_some() && self.model.effects.temperature.is_some()
    }

    /// Returns the report of the drive that was played.
    pub(super) fn compensation(&self) -> Option<Compensation> {
        let drive = self.live.as_ref().map(Live::drive).or(self.drive.as_ref())?;
        let mut compensation = Compensation::new(&self.model, &self.reference, drive);
        compensation.held_s = Some(self.held_s);
        Some(compensation)
    }
}

/// Minimum predicted tracking error that is reported.
/// As a share of the standard deviation of the reference, and of the output range of the model.
const MIN_ERROR_SHARE: f64 = 0.05;
const MIN_ERROR_SHARE_OF_RANGE: f64 = 1e-3;
/// Default hold time at the first value of a reference \[s\].
/// The model assumes that the actuator has settled there.
const DEFAULT_SETTLE_S: f64 = 2.0;
/// Maximum slope of the device over the slope of the planned drive.
/// The margin is for corrections during the run.
const SLEW_MARGIN: f64 = 1.5;
/// As [`SLEW_MARGIN`], for a loop on the device.
const LOOP_SLEW_MARGIN: f64 = 4.0;
/// Block length of a drive that is corrected during the run \[s\].
const LIVE_BLOCK_S: f64 = 0.05;

impl Job {
    /// Reads the files of `args` and computes the drive for a device with these capabilities.
    pub(in crate::commands) fn read(args: &RunArgs, device: &Capabilities) -> CommandResult<Self> {
        let limits = limits(args, device)?;
        thermometer(args.hottest, device)?;
        match (&args.model, &args.reference, &args.drive) {
            (Some(model), Some(reference), None) => Self::follow(args, device, model, reference, limits),
            (None, None, Some(drive)) => Self::play(args, device, drive, limits),
            _ => Err(CommandError::bad_input("give either --model and --reference, or --drive")),
        }
    }

    fn follow(
        args: &RunArgs,
        device: &Capabilities,
        model: &Path,
        reference: &Path,
        limits: VoltageLimits,
    ) -> CommandResult<Self> {
        let (model, json) = input::model(model)?;
        let (driven, measured) = (&model.input.column, &model.output.column);
        if driven != "voltage_v" {
            let message = format!(
                "the model's input is {driven}, but the device is driven by voltage_v; fit a model to records of that column"
            );
            return Err(CommandError::bad_input(message));
        }
        if measured != device.output.column() {
            let message = format!(
                "the model's output is {measured}, but the device measures {}; fit a model to records of that column",
                device.output.column()
            );
            return Err(CommandError::bad_input(message));
        }
        let reference = match Shape::named(reference)? {
            Some(shape) => {
                let usual = model.recorded_at_hz.clamp(device.min_rate_hz, device.max_rate_hz);
                let rate_hz = args.map.rate.unwrap_or(usual);
                shape.record(reference, recording::unit(device.output), rate_hz)?
            }
            // With another rate the actuator would move faster or slower than the reference file says.
            None if args.map.rate.is_some() => {
                return Err(CommandError::bad_input(
                    "--rate needs a reference such as sine:LOW,HIGH,HZ,SECONDS; a reference file is played at its own times",
                ));
            }
            None => input::record(reference, &args.map, Need::Output)?,
        };
        if args.pid.is_some() && !args.control.closes() {
            return Err(CommandError::bad_input("--pid needs --control pid or --control pid+feedforward"));
        }
        if args.limits.bandwidth.is_some() && !args.control.inverts() {
            return Err(CommandError::bad_input(
                "--bandwidth needs --control feedforward or --control pid+feedforward",
            ));
        }
        let mut options = options(&args.limits);
        // Default limits: the range of the model within the range of the device.
        options.voltage = Some(match args.limits.limit {
            Some(limit) => (limit.low, limit.high),
            None => (limits.low.max(model.input.low), limits.high.min(model.input.high)),
        });
        options.slew = options.slew.min(device.max_slew_v_per_s);
        options.temperature = input::temperature(args.temperature, &model, &reference);
        let mut play = play_options(args, device, &reference);
        play.settle_s = args.settle.unwrap_or(DEFAULT_SETTLE_S);
        // The drive follows a measured temperature; the plan uses the given one or the reference temperature of the
        // model.
        let measured = model.effects.temperature.filter(|_| device.temperature && args.control.inverts());
        if let Some(gain) = measured {
            options.temperature = options.temperature.or(Some(gain.reference_degc));
        }
        let adapting = match &args.adapt {
            Some(file) if args.control == Control::Feedforward => Some(Adapting::new(&model, &json, file.as_deref())?),
            Some(_) => {
                return Err(CommandError::bad_input(
                    "--adapt corrects the inverse of the model and works only with --control feedforward; give that",
                ));
            }
            None => None,
        };
        if measured.is_some() || adapting.is_some() {
            play.block = (LIVE_BLOCK_S * play.rate_hz).clamp(1.0, play.block as f64) as usize;
        }
        let (low, high) = options.voltage.unwrap_or((limits.low, limits.high));
        if args.control.closes() && device.queued {
            let degc = options.temperature;
            // A reference that the inverse refuses may still work with the loop, or ends with a fault that has the
            // reason.
            let plan = compensate(&model, &reference, &options).ok();
            let job = Self::hand_over(args, device, model, json, reference, (options, (low, high), plan), play)?;
            return Ok(Self { degc, ..job });
        }
        let drive = args.control.inverts().then(|| compensate(&model, &reference, &options)).transpose()?;
        let planned = match &drive {
            Some(drive) => drive.voltage.clone(),
            None => straight(&model, &reference, low, high)?,
        };
        let live = match &drive {
            Some(drive) if measured.is_some() || adapting.is_some() => {
                Some(Live::new(&model, &reference, &options, drive, play.slew_v_per_s, adapting.clone())?)
            }
            _ => None,
        };
        let segments = split(&reference, &planned);
        let closed = if args.control.closes() {
            play.block = 1;
            let wanted = split(&reference, reference.output().unwrap_or_default());
            Some(Closed::new(args, &model, (low, high), wanted, (1.0 / play.rate_hz, options.slew))?)
        } else {
            None
        };
        let wanted = reference.output().unwrap_or_default().iter().copied().map(Some).collect();
        let followed = Followed {
            model,
            json,
            reference,
            options,
            control: args.control,
            drive,
            live,
            adapting,
            closed,
            held_s: play.settle_s,
        };
        Ok(Self { degc: options.temperature, ..Self::new(args, device, segments, play, wanted, Some(followed)) })
    }

    /// Creates the job of a device that closes the loop itself.
    /// Its measurements arrive too late for a loop on this computer.
    fn hand_over(
        args: &RunArgs,
        device: &Capabilities,
        model: Model,
        json: String,
        reference: Record,
        (options, limits, plan): (CompensateOptions, (f64, f64), Option<Drive>),
        mut play: RecordOptions,
    ) -> CommandResult<Self> {
        if args.control != Control::PidFeedforward {
            return Err(CommandError::bad_input(
                "the measurements of this device arrive too late for a loop on this computer, and the loop on the device needs \
                 the inverse of the model; give --control pid+feedforward",
            ));
        }
        if model.needs_temperature() && !device.temperature {
            return Err(CommandError::bad_input(
                "the model's gain depends on a temperature that this device does not measure; give --control feedforward with \
                 --temperature, or a model without this effect",
            ));
        }
        let period = 1.0 / play.rate_hz;
        // The loop starts and ends at the rest voltage, which may be outside the range of the model.
        let rest_v = device.voltage.rest_v;
        let limits = (limits.0.min(rest_v), limits.1.max(rest_v));
        let Chosen { gains, why, .. } = Chosen::new(args, &model, limits, period)?;
        let block = block(&model).map_err(CommandError::bad_input)?;
        let force = args.kout.map(|stiffness| ForceParams { stiffness, kappa: 1.0, chi: 0.0 });
        let recipe = [recipe_head(Some(&gains), force.as_ref()).as_slice(), &block].concat();
        let late = lateness(&recipe, period as f32).ok_or_else(|| {
            CommandError::bad_input(
                "the device cannot invert this model at this sample rate: it inverts pi models of limited size; fit a model with \
                 --model pi, or give --control feedforward",
            )
        })?;
        let rows = split(&reference, reference.output().unwrap_or_default());
        let range =
            rows.iter().flatten().fold((model.output.low, model.output.high), |(l, h), y| (l.min(*y), h.max(*y)));
        // The ramps cover the range in one second.
        play.slew_v_per_s = (range.1 - range.0).max(f64::MIN_POSITIVE);
        let held = |rows: &Vec<f64>| [&rows[..], &vec![rows.last().copied().unwrap_or_default(); late]].concat();
        let segments = rows.iter().map(held).collect();
        let delayed =
            |rows: &Vec<f64>| std::iter::repeat_n(None, late).chain(rows.iter().copied().map(Some)).collect::<Vec<_>>();
        let wanted = rows.iter().flat_map(delayed).collect();
        let followed = Followed {
            model,
            json,
            reference,
            options,
            control: args.control,
            drive: None,
            live: None,
            adapting: None,
            closed: None,
            held_s: play.settle_s,
        };
        // During the ramp to the reference the drive covers its range in about one second.
        let planned = plan.as_ref().map_or(f64::INFINITY, |plan| {
            let rows = followed.reference.segments().iter();
            rows.map(|rows| steepest_step(&plan.voltage[rows.clone()])).fold(0.0, f64::max) / period
        });
        let least = (limits.1 - limits.0).max(RecordOptions::at(play.rate_hz).slew_v_per_s);
        let default = (LOOP_SLEW_MARGIN * planned.max(least)).min(device.max_slew_v_per_s);
        let slew_v_per_s = args.limits.slew.unwrap_or(default);
        let handed_over = Some(HandedOver { recipe, range, late, gains, why, slew_v_per_s, plan });
        Ok(Self { handed_over, ..Self::new(args, device, segments, play, wanted, Some(followed)) })
    }

    fn new(
        args: &RunArgs,
        device: &Capabilities,
        segments: Vec<Vec<f64>>,
        options: RecordOptions,
        wanted: Vec<Option<f64>>,
        followed: Option<Followed>,
    ) -> Self {
        Self {
            segments,
            options,
            followed,
            wanted,
            handed_over: None,
            symbol: recording::unit(device.output).symbol(),
            recorded: args.record.is_some(),
            log_option: "--log",
            live: args.live,
            plain: args.plain,
            hottest_degc: args.hottest,
            greatest_error: args.max_error,
            degc: None,
            stiffness: args.kout,
        }
    }

    /// Creates a job that records a device at rest, without a drive and without a model.
    pub(in crate::commands) fn at_rest(device: &Capabilities, rows: usize, rate_hz: f64, args: &RecordArgs) -> Self {
        Self {
            segments: vec![vec![device.voltage.rest_v; rows]],
            options: RecordOptions::at(rate_hz),
            followed: None,
            wanted: vec![None; rows],
            handed_over: None,
            symbol: recording::unit(device.output).symbol(),
            recorded: args.output.is_some(),
            log_option: "--log",
            live: args.live,
            plain: args.plain,
            hottest_degc: args.hottest,
            greatest_error: None,
            degc: None,
            stiffness: None,
        }
    }

    fn play(args: &RunArgs, device: &Capabilities, path: &Path, limits: VoltageLimits) -> CommandResult<Self> {
        if args.limits.bandwidth.is_some() {
            return Err(CommandError::bad_input(
                "--bandwidth needs --model and --reference; a drive is played unchanged",
            ));
        }
        if args.temperature.degc.is_some() {
            return Err(CommandError::bad_input(
                "--temperature needs --model and --reference; a drive is played unchanged",
            ));
        }
        if args.map.rate.is_some() {
            return Err(CommandError::bad_input(
                "--rate needs a reference such as sine:LOW,HIGH,HZ,SECONDS; a drive is played at its own times",
            ));
        }
        let drive = input::record(path, &args.map, Need::Input)?;
        let (file, column) = (path.display(), drive.input_column());
        if column != "voltage_v" {
            let message = format!(
                "{file}: the input is {column}, but the device is driven by voltage_v; use --map if only the name differs"
            );
            return Err(CommandError::bad_input(message));
        }
        let (time, volts) = (drive.time(), drive.input());
        if let Some(row) = volts.iter().position(|u| !(limits.low..=limits.high).contains(u)) {
            let (t, u, VoltageLimits { low, high }) = (time[row], volts[row], limits);
            let message = format!(
                "{file}: at {t} s the drive is {u} V, outside {low} to {high} V; nothing was played; make a drive within \
                 these limits"
            );
            return Err(CommandError::bad_input(message));
        }
        let slew = args.limits.slew.unwrap_or(device.max_slew_v_per_s);
        // Tolerance for a drive that was limited to this slew and rounded in its file.
        let step = slew * drive.need_one_sample_period("a drive that a device plays")? * (1.0 + 1e-6);
        let steep = |row: &usize| (volts[row + 1] - volts[*row]).abs() > step;
        if let Some(row) = drive.segments().iter().find_map(|s| (s.start..s.end - 1).find(steep)) {
            let message = format!(
                "{file}: after {} s the drive is steeper than {slew} V/s; nothing was played; make a slower drive",
                time[row]
            );
            return Err(CommandError::bad_input(message));
        }
        let wanted = vec![None; volts.len()];
        let mut options = play_options(args, device, &drive);
        options.settle_s = args.settle.unwrap_or(options.settle_s);
        Ok(Self::new(args, device, split(&drive, volts), options, wanted, None))
    }
}

/// Maximum ratio of a given integral gain and that from the model.
/// Above it the loop has no stability margin.
const MAX_GAIN_RATIO: f64 = 2.0;

/// Returns the largest step between successive voltages \[V\].
fn steepest_step(volts: &[f64]) -> f64 {
    volts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
}

/// Gains of a PID, given or from the model.
struct Chosen {
    gains: PidParams,
    crossover_hz: Option<f64>,
    why: String,
}

impl Chosen {
    fn new(args: &RunArgs, model: &Model, limits: (f64, f64), period: f64) -> CommandResult<Self> {
        let own = loop_gains(model, period, limits).map_err(CommandError::bad_input)?;
        let (gains, why) = match args.pid {
            Some(PidGains { proportional, integral, derivative }) => {
                // Without an integral there is no windup.
                let back = if integral == 0.0 { 1.0 } else { (proportional / integral).abs().max(10.0 * period) };
                let given = PidParams { proportional, integral, derivative, anti_windup_seconds: back, ..own.pid };
                let ratio = integral / own.pid.integral;
                let turned = |gain: f64| gain * own.pid.integral < 0.0;
                if turned(integral) || (integral == 0.0 && turned(proportional)) {
                    return Err(CommandError::bad_input(
                        "--pid: the gain has the wrong sign for this model, and the output would move away from its reference; \
                         change the sign",
                    ));
                }
                if ratio > MAX_GAIN_RATIO {
                    say(&format!(
                        "note: the integral gain {} is {} times the gain with a stability margin of two; the loop may oscillate",
                        text::short(integral),
                        text::short(ratio)
                    ));
                }
                (given, "as given".to_owned())
            }
            None => {
                let why = match own.mode_hz {
                    Some(hz) => format!("limited by the model's mode at {} Hz", text::short(hz)),
                    None => "limited by sample period and dead time".to_owned(),
                };
                (own.pid, format!("bandwidth {} Hz, {why}", text::short(own.crossover_hz)))
            }
        };
        Ok(Self { gains, crossover_hz: args.pid.is_none().then_some(own.crossover_hz), why })
    }
}

impl Closed {
    fn new(
        args: &RunArgs,
        model: &Model,
        limits: (f64, f64),
        wanted: Vec<Vec<f64>>,
        (period, slew): (f64, f64),
    ) -> CommandResult<Self> {
        let Chosen { gains, crossover_hz, why } = Chosen::new(args, model, limits, period)?;
        let tolerance = SATURATION_TOLERANCE * (model.output.high - model.output.low);
        let running = ClosedLoop::new(&gains, args.control.inverts(), wanted, period, slew, tolerance)?;
        Ok(Self { running, gains, crossover_hz, why })
    }
}

/// Returns the drive of a constant gain: a straight line through the ends of the model's range.
/// The drive is clamped to the limits.
fn straight(model: &Model, reference: &Record, low: f64, high: f64) -> CommandResult<Vec<f64>> {
    let wanted = match reference.output_unit() {
        Some(unit) if unit.column() == model.output.column => reference.output().unwrap_or_default(),
        _ => {
            let (column, file) = (&model.output.column, reference.name());
            return Err(CommandError::bad_input(format!(
                "{file}: column {column} is missing; the reference needs the output column of the model"
            )));
        }
    };
    let (gain, at_low) = model.straight_line().map_err(CommandError::bad_input)?;
    Ok(wanted.iter().map(|y| (model.input.low + (y - at_low) / gain).clamp(low, high)).collect())
}

/// Refuses a limit on the temperature for a device that does not measure it.
pub(in crate::commands) fn thermometer(hottest_degc: Option<f64>, device: &Capabilities) -> CommandResult {
    if hottest_degc.is_some() && !device.temperature {
        let message = format!(
            "--hottest: {} does not measure a temperature; leave --hottest out and monitor the temperature another way",
            device.device
        );
        return Err(CommandError::bad_input(message));
    }
    Ok(())
}

/// Returns the limits of the drive: those of the command line, or of the device.
fn limits(args: &RunArgs, device: &Capabilities) -> CommandResult<VoltageLimits> {
    let (low, high, rest) = (device.voltage.min_v, device.voltage.max_v, device.voltage.rest_v);
    match args.limits.limit {
        None => Ok(VoltageLimits { low, high }),
        Some(limit) if device.queued && !(limit.low..=limit.high).contains(&rest) => {
            Err(CommandError::bad_input(format!(
                "--limit {},{} excludes {rest} V, at which the device rests; give limits that include it",
                limit.low, limit.high
            )))
        }
        Some(limit) if limit.low >= low && limit.high <= high => Ok(limit),
        Some(limit) => Err(CommandError::bad_input(format!(
            "--limit {},{} exceeds the range of the device, {low} to {high} V; give limits within it",
            limit.low, limit.high
        ))),
    }
}

fn play_options(args: &RunArgs, device: &Capabilities, record: &Record) -> RecordOptions {
    let rate_hz = 1.0 / record.sample_period();
    let whole = rate_hz.round();
    // 1 / 0.00001 is not exactly 100000.
    let rate_hz = if (rate_hz - whole).abs() < 1e-9 * rate_hz { whole } else { rate_hz };
    let mut options = RecordOptions::at(rate_hz);
    options.rest_s = args.rest;
    options.slew_v_per_s = options.slew_v_per_s.min(args.limits.slew.unwrap_or(device.max_slew_v_per_s));
    options
}

fn split(record: &Record, values: &[f64]) -> Vec<Vec<f64>> {
    record.segments().iter().map(|rows| values[rows.clone()].to_vec()).collect()
}
