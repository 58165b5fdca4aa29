//! Test of adaptation: a device with other physics whose gain falls and whose loop widens while `hystctl run` controls
//! it.

use std::sync::{Arc, Mutex, PoisonError};

use hyst_cli::host::{Host, HostDaq, HostDaqError, command};
use hyst_hw::{Capabilities, Daq, Sample};
use hyst_ident::model::Model;

use crate::learning::identify;
use crate::other_bench::{Bench, OtherDevice};

/// A device that several commands use in turn.
#[derive(Clone)]
struct Shared(Arc<Mutex<OtherDevice>>, Capabilities);

impl Shared {
    fn new(device: OtherDevice) -> Self {
        let capabilities = device.capabilities().clone();
        Self(Arc::new(Mutex::new(device)), capabilities)
    }

    fn with<T>(&self, act: impl FnOnce(&mut OtherDevice) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Daq for Shared {
    type Error = HostDaqError;

    fn capabilities(&self) -> &Capabilities {
        &self.1
    }
    fn present_v(&self) -> f64 {
        self.with(|device| device.present_v())
    }
    fn start(&mut self, rate_hz: f64) -> Result<f64, HostDaqError> {
        self.with(|device| device.start(rate_hz)).map_err(|never| match never {})
    }
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, HostDaqError> {
        self.with(|device| device.exchange(drive_v, measured)).map_err(|never| match never {})
    }
    fn rest(&mut self, seconds: f64) -> Result<(), HostDaqError> {
        self.with(|device| device.rest(seconds)).map_err(|never| match never {})
    }
    fn stop(&mut self) -> Result<(), HostDaqError> {
        self.with(|device| device.stop()).map_err(|never| match never {})
    }
}

impl HostDaq for Shared {
    fn gentle(&mut self, _: f64) {}
}

/// RMS tracking errors over the last minute of a run on the aged device \[µm\].
#[derive(Clone, Copy, Debug)]
pub struct Aged {
    /// With the model that was fitted to the new device.
    pub initial: f64,
    /// With that model and `--adapt`.
    pub adapted: f64,
    /// With a model that was fitted to the aged device.
    pub refitted: f64,
}

/// Follows a sine of 1 Hz. Within `seconds`, the gain falls by 5 % and the loop widens by 20 %; the run continues for
/// another minute. Returns the errors with three models.
///
/// # Panics
/// If a command fails.
pub fn aged(bench: Bench, seconds: f64) -> Aged {
    let mut device = OtherDevice::new(bench);
    let model = identify(&mut device, false);
    device.age(seconds, 0.05, 0.2);
    let device = Shared::new(device);
    let adapted = follow(&device, &model, &model, seconds + 60.0, true);
    // The device does not change any more.
    let initial = follow(&device, &model, &model, 70.0, false);
    let refitted = device.with(|device| identify(device, false));
    Aged { initial, adapted, refitted: follow(&device, &refitted, &model, 70.0, false) }
}

/// Follows the reference with `model`, between 20 and 80 % of the output range of `range`. Returns the error of the
/// last minute.
fn follow(device: &Shared, model: &Model, range: &Model, seconds: f64, adapts: bool) -> f64 {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (model_path, record) = (path("model.json"), path("record.csv"));
    std::fs::write(&model_path, model.to_json()).expect("a file");
    let (low, high) = (range.output.low, range.output.high);
    let reference = format!("sine:{},{},1,{seconds}", low + 0.2 * (high - low), low + 0.8 * (high - low));
    let mut words = vec!["hystctl", "run", "--daq", "host:", "--model", &model_path, "--reference", &reference];
    words.extend(["--record", &record]);
    words.extend(adapts.then_some("--adapt"));
    let host = Host { daq: Some(Box::new(device.clone())), ..Host::default() };
    let ended = command(words.iter().map(|word| (*word).into()), host);
    assert_eq!(ended.exit, 0, "{:?}", ended.error);
    last_minute(&std::fs::read_to_string(record).expect("a record"))
}

/// Returns the RMS of reference minus output over the last 60 s of a record.
fn last_minute(csv: &str) -> f64 {
    let mut lines = csv.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let at = |name: &str| header.iter().position(|column| *column == name).expect("a column");
    let (time, wanted, output) = (at("time_s"), at("reference_um"), at("displacement_um"));
    let rows: Vec<[f64; 3]> = lines
        .map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            [cells[time], cells[wanted], cells[output]]
        })
        .collect();
    let end = rows.last().expect("rows")[0] - 60.0;
    let errors: Vec<f64> = rows.iter().filter(|row| row[0] > end).map(|row| row[1] - row[2]).collect();
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}
