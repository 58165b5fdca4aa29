//! What a run plays: a drive as it stands, or the one that makes the output follow a reference.

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
use super::beside::{Beside, Force};
use super::control::ClosedLoop;
use super::live::Live;
use super::shape::Shape;
use crate::cli::{Control, PidGains, RecordArgs, RunArgs, VoltageLimits};
use crate::commands::compensate::{Compensation, options};
use crate::exit::{CommandError, CommandResult};
use crate::output::say;
use crate::{input, recording, text};

/// Everything that has to be known before a device moves.
#[derive(Debug)]
pub(in crate::commands) struct Job {
    /// Voltages of each segment \[V\].
    pub(in crate::commands) segments: Vec<Vec<f64>>,
    /// How they are played.
    pub(in crate::commands) options: RecordOptions,
    /// What is followed, unless a drive is played as it stands.
    pub(in crate::commands) followed: Option<Followed>,
    /// Wanted output at each of the voltages, where there is one.
    pub(in crate::commands) wanted: Vec<Option<f64>>,
    /// What the device is to follow references with: then the voltages above are references.
    pub(super) handed_over: Option<HandedOver>,
    /// Symbol of the output's unit.
    pub(super) symbol: &'static str,
    /// Whether a record of it is written.
    pub(super) recorded: bool,
    /// The option that keeps what is measured as it comes.
    pub(in crate::commands) log_option: &'static str,
    /// Where viewers are served, if they are.
    pub(super) live: Option<SocketAddr>,
    /// Whether a bar is to be shown instead of a picture.
    pub(super) plain: bool,
    /// Highest temperature \[°C\] and greatest tracking error \[output unit\] of the run.
    pub(super) hottest_degc: Option<f64>,
    pub(super) greatest_error: Option<f64>,
    /// Temperature where none is measured \[°C\], and stiffness with which a force is estimated \[N/output unit\].
    degc: Option<f64>,
    stiffness: Option<f64>,
}

/// A controller that runs on the device.
#[derive(Debug)]
pub(super) struct HandedOver {
    /// As the device reads it.
    pub(super) recipe: Vec<u8>,
    /// Lowest and highest reference \[output unit\].
    pub(super) range: (f64, f64),
    /// Rows by which the output is later than the references.
    pub(super) late: usize,
    gains: PidParams,
    why: String,
    slew_v_per_s: f64,
    /// The drive that the model's inverse has in mind, where there is one: the loop stays near it.
    plan: Option<Drive>,
}

impl HandedOver {
    /// Share of the rows in which the drive stood at a limit and the output away from what was wanted \[%\].
    fn limited_percent(&self, recording: &Recording, followed: &Followed) -> f64 {
        let PidParams { low, high, .. } = self.gains;
        // The device's numbers are f32.
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

/// A reference, and the model that computes its drive.
#[derive(Debug)]
pub(in crate::commands) struct Followed {
    pub(in crate::commands) model: Model,
    /// The text of the model's file.
    pub(in crate::commands) json: String,
    pub(in crate::commands) reference: Record,
    /// Limits and surroundings of its drive.
    pub(in crate::commands) options: CompensateOptions,
    /// What makes the drive.
    pub(super) control: Control,
    /// The drive as planned by the model's inverse, where that takes part.
    pub(super) drive: Option<Drive>,
    /// The drive as it is corrected on the way, where the model needs a temperature that the device measures, or is adapted.
    pub(in crate::commands) live: Option<Live>,
    /// What keeps up with the actuator, where that was asked for.
    pub(super) adapting: Option<Adapting>,
    /// The PID, where one takes part.
    pub(super) closed: Option<Closed>,
    /// How long the device is held at the first value of a segment \[s\].
    held_s: f64,
}

/// A PID, and why it has these gains.
#[derive(Debug)]
pub(super) struct Closed {
    pub(super) running: ClosedLoop,
    pub(super) gains: PidParams,
    /// Of gains from the model \[Hz\].
    pub(super) crossover_hz: Option<f64>,
    /// In words.
    pub(super) why: String,
}

impl Job {
    /// The model that runs beside the device, where there is one.
    pub(super) fn beside(&self) -> CommandResult<Option<Beside>> {
        let Some(followed) = &self.followed else { return Ok(None) };
        let on_device = self.handed_over.is_some();
        let force = self.stiffness.map(|stiffness| if on_device { Force::OnDevice } else { Force::Here(stiffness) });
        let beside = Beside::new(&followed.model, self.options.rate_hz, self.degc, force, followed.adapting.clone())?;
        if beside.is_none() && self.stiffness.is_some() && !on_device {
            return Err(CommandError::bad_input(
                "--kout needs a model that can be run as the drive comes; this one has to know all of it (band-limited): estimate the force afterwards, with hystctl force",
            ));
        }
        Ok(beside)
    }

    /// How steep the device has to go \[V/s\].
    pub(in crate::commands) fn steepest(&self) -> f64 {
        if let Some(HandedOver { slew_v_per_s, .. }) = self.handed_over {
            return slew_v_per_s;
        }
        let steep = |volts: &[f64]| steepest_step(volts) * self.options.rate_hz;
        let steepest = self.segments.iter().map(|volts| steep(volts)).fold(0.0, f64::max);
        STEEPER * steepest.max(self.options.slew_v_per_s)
    }

    /// What the model foresees to go wrong, if that is much.
    pub(in crate::commands) fn foreseen(&self) -> Option<String> {
        let followed = self.followed.as_ref()?;
        let plan = self.handed_over.as_ref().and_then(|handed| handed.plan.as_ref());
        followed.foreseen(followed.drive.as_ref().or(plan)?)
    }

    /// Takes the rows away in which the output had not come to a reference's beginning yet, and the forces of these rows.
    pub(super) fn align(&self, recording: &mut Recording, forces: &mut [Vec<f64>]) {
        let Some(HandedOver { late, .. }) = self.handed_over else { return };
        for segment in &mut recording.segments {
            segment.samples.drain(..late.min(segment.samples.len()));
        }
        for forces in forces {
            forces.drain(..late.min(forces.len()));
        }
    }

    /// The PID that took part: its gains, where they come from, bandwidth \[Hz\] and share of limited samples \[%\].
    pub(super) fn pid(&self, recording: &Recording) -> Option<Told<'_>> {
        if let (Some(handed), Some(followed)) = (&self.handed_over, &self.followed) {
            let limited_percent = Some(handed.limited_percent(recording, followed));
            return Some(Told { gains: &handed.gains, why: &handed.why, crossover_hz: None, limited_percent });
        }
        let Closed { running, gains, crossover_hz, why } = self.followed.as_ref()?.closed.as_ref()?;
        let limited_percent = Some(running.limited_percent());
        Some(Told { gains, why, crossover_hz: *crossover_hz, limited_percent })
    }
}

/// A PID that took part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told<'a> {
    pub(super) gains: &'a PidParams,
    pub(super) why: &'a str,
    /// \[Hz\]
    pub(super) crossover_hz: Option<f64>,
    /// \[%\]
    pub(super) limited_percent: Option<f64>,
}

impl Followed {
    /// Wanted output, over all segments.
    pub(super) fn wanted(&self) -> &[f64] {
        self.reference.output().unwrap_or_default()
    }

    /// What the model foresees to go wrong with the drive as planned, if that is much, and why.
    fn foreseen(&self, drive: &Drive) -> Option<String> {
        let Drive { bandwidth_hz, voltage_limited, slew_limited, missed, .. } = drive;
        let wanted = self.wanted();
        let count = wanted.len().max(1) as f64;
        let mean = wanted.iter().sum::<f64>() / count;
        let spread = (wanted.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt();
        let (low, high) = (self.model.output.low, self.model.output.high);
        if missed.settled_rmse <= (FORESEEN * spread).max(FORESEEN_OF_RANGE * (high - low)) {
            return None;
        }
        let mut why = Vec::new();
        for (rows, what) in [(voltage_limited, "voltage"), (slew_limited, "slew")] {
            if !rows.is_empty() {
                why.push(format!("the {what} is limited in {} of {}", rows.len(), text::count(wanted.len(), "row")));
            }
        }
        if let (Some(hz), true) = (bandwidth_hz, why.is_empty()) {
            why.push(format!("nothing above {} Hz is inverted", text::short(*hz)));
        }
        let unit = text::symbol(&self.model.output.unit);
        let (missed, why) = (text::short(missed.settled_rmse), why.join(", "));
        let why = if why.is_empty() { String::new() } else { format!(" ({why})") };
        Some(format!("with the drive as planned the model itself misses the reference by {missed} {unit} RMS{why}"))
    }

    /// Wanted output at each row of a recording, whose segments may end before their time.
    pub(super) fn wanted_at(&self, recording: &Recording) -> Vec<f64> {
        let wanted = self.wanted();
        let rows = self.reference.segments().iter().zip(&recording.segments);
        rows.flat_map(|(rows, segment)| wanted[rows.clone()].iter().take(segment.samples.len())).copied().collect()
    }

    /// Whether the drive was corrected on the way and depends on a temperature.
    pub(super) fn needs_temperature(&self) -> bool {
        self.live.is_some() && self.model.effects.temperature.is_some()
    }

    /// What there is to say about the drive that was played.
    pub(super) fn compensation(&self) -> Option<Compensation> {
        let drive = self.live.as_ref().map(Live::drive).or(self.drive.as_ref())?;
        let mut said = Compensation::new(&self.model, &self.reference, drive);
        said.held_s = Some(self.held_s);
        Some(said)
    }
}

/// What a planned drive may miss without a word: as a share of the reference's deviation from its mean, and of the model's travel.
const FORESEEN: f64 = 0.05;
const FORESEEN_OF_RANGE: f64 = 1e-3;
/// How long a device is held at the first value of a reference, if nothing is said \[s\]: the model takes it as settled there.
const USUAL_SETTLE_S: f64 = 2.0;
/// By how much steeper than the planned drive, which may be corrected on the way, the device may go.
const STEEPER: f64 = 1.5;
/// As [`STEEPER`], where a loop on the device corrects it.
const LOOP_STEEPER: f64 = 4.0;
/// How much of a drive is sent at once where it is corrected by what is measured \[s\].
const LIVE_BLOCK_S: f64 = 0.05;

impl Job {
    /// Reads the files that `args` names and computes the drive for a device that can do `device`.
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
            let message = format!("the model's input is {driven}, but the device is driven by a voltage");
            return Err(CommandError::bad_input(message));
        }
        if measured != device.output.column() {
            let message = format!(
                "the model's output is {measured}, but the device measures {}: fit a model to records of that column",
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
            // At another rate than its own a reference would move the actuator faster or slower than its file says.
            None if args.map.rate.is_some() => {
                return Err(CommandError::bad_input(
                    "--rate is for a reference as sine:LOW,HIGH,HZ,SECONDS; a file needs times of its own",
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
        // Not given, the limits are the model's, as far as the device goes along.
        options.voltage = Some(match args.limits.limit {
            Some(limit) => (limit.low, limit.high),
            None => (limits.low.max(model.input.low), limits.high.min(model.input.high)),
        });
        options.slew = options.slew.min(device.max_slew_v_per_s);
        options.temperature = input::temperature(args.temperature, &model, &reference);
        let mut play = play_options(args, device, &reference);
        play.settle_s = args.settle.unwrap_or(USUAL_SETTLE_S);
        // A temperature that is measured is followed; the plan starts from the given one, or the one that the gain is stated for.
        let measured = model.effects.temperature.filter(|_| device.temperature && args.control.inverts());
        if let Some(gain) = measured {
            options.temperature = options.temperature.or(Some(gain.reference_degc));
        }
        let adapting = match &args.adapt {
            Some(file) if args.control == Control::Feedforward => Some(Adapting::new(&model, &json, file.as_deref())?),
            Some(_) => {
                return Err(CommandError::bad_input(
                    "--adapt corrects what the inverse aims at, and a PID would take its part: give --control feedforward",
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
            // Where the inverse alone would be refused, the loop may find its way or end with a fault that says why.
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

    /// For a device that closes the loop itself: what it measures comes too late for one that is closed here.
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
                "what this device measures comes too late for a loop that is closed on this computer, and its own loop is around a model's inverse: give --control pid+feedforward",
            ));
        }
        if model.needs_temperature() && !device.temperature {
            return Err(CommandError::bad_input(
                "the model's gain follows a temperature that this device does not measure: give --control feedforward with --temperature, or a model without that effect",
            ));
        }
        let period = 1.0 / play.rate_hz;
        // The loop begins and ends where the device rests, also where the model's record does not reach that far.
        let rest_v = device.voltage.rest_v;
        let limits = (limits.0.min(rest_v), limits.1.max(rest_v));
        let Chosen { gains, why, .. } = Chosen::new(args, &model, limits, period)?;
        let block = block(&model).map_err(CommandError::bad_input)?;
        let force = args.kout.map(|stiffness| ForceParams { stiffness, kappa: 1.0, chi: 0.0 });
        let recipe = [recipe_head(Some(&gains), force.as_ref()).as_slice(), &block].concat();
        let late = lateness(&recipe, period as f32).ok_or_else(|| {
            CommandError::bad_input(
                "the device has no inverse of this model at this rate: it takes models of kind pi with what an inverse needs room for; fit one with --model pi, or use --control feedforward",
            )
        })?;
        let rows = split(&reference, reference.output().unwrap_or_default());
        let range =
            rows.iter().flatten().fold((model.output.low, model.output.high), |(l, h), y| (l.min(*y), h.max(*y)));
        // From one end to the other in a second.
        play.slew_v_per_s = (range.1 - range.0).max(f64::MIN_POSITIVE);
        let held = |rows: &Vec<f64>| [&rows[..], &vec![rows.last().copied().unwrap_or_default(); late]].concat();
        let segments = rows.iter().map(held).collect();
        let told =
            |rows: &Vec<f64>| std::iter::repeat_n(None, late).chain(rows.iter().copied().map(Some)).collect::<Vec<_>>();
        let wanted = rows.iter().flat_map(told).collect();
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
        // On the way to the reference the drive goes over its range in about a second.
        let planned = plan.as_ref().map_or(f64::INFINITY, |plan| {
            let rows = followed.reference.segments().iter();
            rows.map(|rows| steepest_step(&plan.voltage[rows.clone()])).fold(0.0, f64::max) / period
        });
        let least = (limits.1 - limits.0).max(RecordOptions::at(play.rate_hz).slew_v_per_s);
        let usual = (LOOP_STEEPER * planned.max(least)).min(device.max_slew_v_per_s);
        let slew_v_per_s = args.limits.slew.unwrap_or(usual);
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

    /// At rest for so many samples, without a drive and without a model.
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
                "--bandwidth needs --model and --reference: a drive is played as it stands",
            ));
        }
        if args.temperature.degc.is_some() {
            return Err(CommandError::bad_input(
                "--temperature needs --model and --reference: a drive is played as it stands",
            ));
        }
        if args.map.rate.is_some() {
            return Err(CommandError::bad_input(
                "--rate is for a reference: a drive is played at the times of its file",
            ));
        }
        let drive = input::record(path, &args.map, Need::Input)?;
        let (file, column) = (path.display(), drive.input_column());
        if column != "voltage_v" {
            let message = format!(
                "{file}: the input is {column}, but the device is driven by voltage_v; use --map if only its name differs"
            );
            return Err(CommandError::bad_input(message));
        }
        let (time, volts) = (drive.time(), drive.input());
        if let Some(row) = volts.iter().position(|u| !(limits.low..=limits.high).contains(u)) {
            let (t, u, VoltageLimits { low, high }) = (time[row], volts[row], limits);
            let message = format!("{file}: at {t} s the drive is {u} V, outside {low} to {high} V; nothing was played");
            return Err(CommandError::bad_input(message));
        }
        let slew = args.limits.slew.unwrap_or(device.max_slew_v_per_s);
        // A drive that was limited to this slew has been printed and read since.
        let step = slew * drive.need_one_sample_period("a drive that a device plays")? * (1.0 + 1e-6);
        let steep = |row: &usize| (volts[row + 1] - volts[*row]).abs() > step;
        if let Some(row) = drive.segments().iter().find_map(|s| (s.start..s.end - 1).find(steep)) {
            let message =
                format!("{file}: after {} s the drive is steeper than {slew} V/s; nothing was played", time[row]);
            return Err(CommandError::bad_input(message));
        }
        let wanted = vec![None; volts.len()];
        let mut options = play_options(args, device, &drive);
        options.settle_s = args.settle.unwrap_or(options.settle_s);
        Ok(Self::new(args, device, split(&drive, volts), options, wanted, None))
    }
}

/// From how many times the model's own integral gain on a given one leaves no margin.
const TOO_MUCH: f64 = 2.0;

/// Largest step between neighbours \[V\].
fn steepest_step(volts: &[f64]) -> f64 {
    volts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
}

/// Gains, as given or from the model.
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
                // Where nothing is integrated, nothing winds up.
                let back = if integral == 0.0 { 1.0 } else { (proportional / integral).abs().max(10.0 * period) };
                let given = PidParams { proportional, integral, derivative, anti_windup_seconds: back, ..own.pid };
                let ratio = integral / own.pid.integral;
                let turned = |gain: f64| gain * own.pid.integral < 0.0;
                if turned(integral) || (integral == 0.0 && turned(proportional)) {
                    return Err(CommandError::bad_input(
                        "--pid: the gain has the wrong sign for this model: the loop would drive the output away from its reference",
                    ));
                }
                if ratio > TOO_MUCH {
                    say(&format!(
                        "note: an integral gain of {} is {} times what the model allows with a margin of two: the loop may oscillate",
                        text::short(integral),
                        text::short(ratio)
                    ));
                }
                (given, "as given".to_owned())
            }
            None => {
                let why = match own.mode_hz {
                    Some(hz) => format!("the model's mode at {} Hz allows no more", text::short(hz)),
                    None => "sample period and dead time allow no more".to_owned(),
                };
                (own.pid, format!("bandwidth {} Hz: {why}", text::short(own.crossover_hz)))
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

/// A drive along the straight line through the ends of what the model was fitted to, within the limits.
fn straight(model: &Model, reference: &Record, low: f64, high: f64) -> CommandResult<Vec<f64>> {
    let wanted = match reference.output_unit() {
        Some(unit) if unit.column() == model.output.column => reference.output().unwrap_or_default(),
        _ => {
            let (column, file) = (&model.output.column, reference.name());
            return Err(CommandError::bad_input(format!(
                "{file}: column {column} is missing; the reference says what the output is to do"
            )));
        }
    };
    let (gain, at_low) = model.straight_line().map_err(CommandError::bad_input)?;
    Ok(wanted.iter().map(|y| (model.input.low + (y - at_low) / gain).clamp(low, high)).collect())
}

/// A limit on a temperature that nobody measures would guard nothing.
pub(in crate::commands) fn thermometer(hottest_degc: Option<f64>, device: &Capabilities) -> CommandResult {
    if hottest_degc.is_some() && !device.temperature {
        let message = format!(
            "--hottest: {} measures no temperature; run without that limit, and watch it otherwise",
            device.device
        );
        return Err(CommandError::bad_input(message));
    }
    Ok(())
}

/// The voltages that may be applied: what the device can do, and no more than what the command line allows.
fn limits(args: &RunArgs, device: &Capabilities) -> CommandResult<VoltageLimits> {
    let (low, high, rest) = (device.voltage.min_v, device.voltage.max_v, device.voltage.rest_v);
    match args.limits.limit {
        None => Ok(VoltageLimits { low, high }),
        Some(limit) if device.queued && !(limit.low..=limit.high).contains(&rest) => {
            Err(CommandError::bad_input(format!(
                "--limit {},{} leaves out the {rest} V at which the device rests; give limits around that",
                limit.low, limit.high
            )))
        }
        Some(limit) if limit.low >= low && limit.high <= high => Ok(limit),
        Some(limit) => Err(CommandError::bad_input(format!(
            "--limit {},{} goes beyond the device, which can do {low} to {high} V; give limits within that",
            limit.low, limit.high
        ))),
    }
}

fn play_options(args: &RunArgs, device: &Capabilities, record: &Record) -> RecordOptions {
    let rate_hz = 1.0 / record.sample_period();
    let whole = rate_hz.round();
    // 1 / 0.00001 is not 100000 to the last bit.
    let rate_hz = if (rate_hz - whole).abs() < 1e-9 * rate_hz { whole } else { rate_hz };
    let mut options = RecordOptions::at(rate_hz);
    options.rest_s = args.rest;
    options.slew_v_per_s = options.slew_v_per_s.min(args.limits.slew.unwrap_or(device.max_slew_v_per_s));
    options
}

fn split(record: &Record, values: &[f64]) -> Vec<Vec<f64>> {
    record.segments().iter().map(|rows| values[rows.clone()].to_vec()).collect()
}
