//! References without a file: sines, triangles, steps and scan patterns between two outputs.

use std::f64::consts::TAU;
use std::path::Path;
use std::str::FromStr;

use hyst_ident::excite::{Raster, Spiral};
use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::exit::{CommandError, CommandResult};

/// Maximum length of a reference \[rows\].
const MAX_ROWS: f64 = 1e8;

/// A reference as its argument describes it.
/// It starts at its lower end; spirals and Lissajous sines start in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::commands) struct Shape {
    form: Form,
    low: f64,
    high: f64,
    /// Frequency of one period, for steps of all steps up and down \[Hz\].
    hz: f64,
    seconds: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Sine,
    Triangle,
    Steps,
    /// Lines with rounded turning points.
    Raster,
    /// First axis of a spiral, from the middle outwards.
    Spiral,
    /// Second axis of a spiral.
    SpiralY,
    /// One axis of a Lissajous pattern.
    Lissajous,
}

impl Form {
    const ALL: [(&'static str, Self); 7] = [
        ("sine", Self::Sine),
        ("triangle", Self::Triangle),
        ("steps", Self::Steps),
        ("raster", Self::Raster),
        ("spiral", Self::Spiral),
        ("spiral-y", Self::SpiralY),
        ("lissajous", Self::Lissajous),
    ];

    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(known, _)| *known == name).map(|(_, form)| *form)
    }
}

/// Share of the time of a raster that is spent in turning points.
const TURNING_SHARE: f64 = 0.2;

/// Maximum frequency as a share of the sample rate.
/// With fewer samples per period the shape is distorted.
const MAX_FREQUENCY_SHARE: f64 = 0.1;

/// Number of steps from one end to the other.
const STEPS: f64 = 5.0;

impl FromStr for Shape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (form, numbers) = text.split_once(':').ok_or("there is no colon")?;
        let form = Form::named(form).ok_or_else(|| format!("\"{form}\" is not a form"))?;
        let cells: Vec<&str> = numbers.split(',').map(str::trim).collect();
        let &[low, high, hz, seconds] = &cells[..] else {
            let many = if numbers.is_empty() { 0 } else { cells.len() };
            return Err(format!("expected four numbers after the colon, not {many}"));
        };
        let number = |name: &str, cell: &str| {
            let x = cell.parse::<f64>().ok().filter(|x| x.is_finite());
            x.ok_or_else(|| format!("{name} is \"{cell}\", not a finite number"))
        };
        let positive = |name: &str, cell: &str| match number(name, cell)? {
            x if x > 0.0 => Ok(x),
            x => Err(format!("{name} is {x}, but must be positive")),
        };
        let (low, high) = (number("LOW", low)?, number("HIGH", high)?);
        if low >= high {
            return Err(format!("LOW is {low}, but must be below HIGH, {high}"));
        }
        Ok(Self { form, low, high, hz: positive("HZ", hz)?, seconds: positive("SECONDS", seconds)? })
    }
}

impl Shape {
    /// Parses the shape that `path` names; `None` for a file.
    pub(in crate::commands) fn named(path: &Path) -> CommandResult<Option<Self>> {
        let Some(text) = path.to_str().filter(|_| !path.exists()) else { return Ok(None) };
        let Some((form, _)) = text.split_once(':') else { return Ok(None) };
        if Form::named(form).is_none() {
            // One letter is a drive of Windows.
            let word = form.len() > 1 && form.chars().all(|c| c.is_ascii_alphabetic() || c == '-');
            let names: Vec<&str> = Form::ALL.iter().map(|(name, _)| *name).collect();
            let message = format!(
                "{text}: no such file, and \"{form}\" is not a form of a reference; give one of {}, for example \
                 sine:2,12,5,10",
                names.join(", ")
            );
            return if word { Err(CommandError::bad_input(message)) } else { Ok(None) };
        }
        text.parse().map(Some).map_err(|wrong: String| {
            CommandError::bad_input(format!(
                "{text}: {wrong}; give FORM:LOW,HIGH,HZ,SECONDS, for example sine:2,12,5,10"
            ))
        })
    }

    /// Returns the value at a time \[s\].
    fn at(&self, t: f64) -> f64 {
        let phase = (t * self.hz).fract();
        let up = 1.0 - (2.0 * phase - 1.0).abs();
        let share = match self.form {
            Form::Sine => 0.5 - 0.5 * (TAU * phase).cos(),
            Form::Triangle => up,
            Form::Steps => (STEPS * up).round() / STEPS,
            Form::Raster => Raster::position(phase, TURNING_SHARE),
            Form::Spiral => Spiral::position(t / self.seconds, t * self.hz, 0.0),
            Form::SpiralY => Spiral::position(t / self.seconds, t * self.hz, 90.0),
            Form::Lissajous => 0.5 + 0.5 * (TAU * phase).sin(),
        };
        self.low + (self.high - self.low) * share
    }

    /// Returns the reference as a record at `rate_hz`.
    pub(in crate::commands) fn record(&self, path: &Path, unit: OutputUnit, rate_hz: f64) -> CommandResult<Record> {
        let rows = (self.seconds * rate_hz).round();
        if !(2.0..=MAX_ROWS).contains(&rows) {
            let message = format!(
                "{}: {} s at {rate_hz} Hz are {rows} rows, expected 2 to {MAX_ROWS}; give another SECONDS",
                path.display(),
                self.seconds
            );
            return Err(CommandError::bad_input(message));
        }
        if self.hz > MAX_FREQUENCY_SHARE * rate_hz {
            let message = format!(
                "{}: {} Hz at {rate_hz} samples per second has fewer than {} samples per period; give a lower frequency or a \
                 higher --rate",
                path.display(),
                self.hz,
                1.0 / MAX_FREQUENCY_SHARE
            );
            return Err(CommandError::bad_input(message));
        }
        let time: Vec<f64> = (0..rows as usize).map(|k| k as f64 / rate_hz).collect();
        let values = time.iter().map(|t| self.at(*t)).collect();
        let name = path.display().to_string();
        Ok(Record::from_samples(Columns { name, time, output: Some((unit, values)), ..Columns::default() })?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_start_at_their_lower_end_and_reach_the_upper_end() {
        for form in ["sine", "triangle", "steps", "raster"] {
            let path = format!("{form}:2,12,5,1");
            let shape = Shape::named(Path::new(&path)).unwrap().unwrap();
            let record = shape.record(Path::new(&path), OutputUnit::Micrometre, 1000.0).unwrap();
            let y = record.output().unwrap();
            assert_eq!((y.len(), y[0], y[100]), (1000, 2.0, 12.0), "{form}");
            assert!(y.iter().all(|y| (2.0..=12.0).contains(y)));
            assert_eq!(y[0].to_bits(), y[200].to_bits());
        }
    }

    #[test]
    fn scan_patterns_have_their_speed_and_radius() {
        let of = |form: &str| {
            let path = format!("{form}:2,12,5,1");
            let shape = Shape::named(Path::new(&path)).unwrap().unwrap();
            shape.record(Path::new(&path), OutputUnit::Micrometre, 1000.0).unwrap().output().unwrap().to_vec()
        };
        // Each line spends 10 % of its time in the turning point at each end, so the constant speed is 100/0.9 µm/s.
        let raster = of("raster");
        let slopes: Vec<f64> = raster.windows(2).map(|w| 1e3 * (w[1] - w[0])).collect();
        assert!(slopes[10..90].iter().all(|v| (v - 100.0 / 0.9).abs() < 1e-6), "{slopes:?}");
        assert!(slopes[99].abs() < 10.0 && slopes.windows(2).all(|w| (w[1] - w[0]).abs() < 12.0), "{slopes:?}");
        let (x, y) = (of("spiral"), of("spiral-y"));
        for k in (0..1000).step_by(37) {
            let radius = (x[k] - 7.0).hypot(y[k] - 7.0);
            assert!((radius - 5.0 * k as f64 / 1000.0).abs() < 1e-9, "row {k}: {radius}");
        }
        let sine = of("lissajous");
        assert!((sine[0] - 7.0).abs() < 1e-12 && (sine[50] - 12.0).abs() < 1e-12 && (sine[150] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn wrong_shapes_are_refused_and_files_are_not_shapes() {
        for (text, what) in [
            ("sine:1,2,3", "colon, not 3;"),
            ("sine:", "colon, not 0;"),
            ("sine:0,1,1,1,", "colon, not 5;"),
            ("sine:1,2,x,3", "HZ is \"x\", not a finite number;"),
            ("sine:0,1,1,inf", "SECONDS is \"inf\", not a finite number;"),
            ("steps:1,inf,2,3", "HIGH is \"inf\", not a finite number;"),
            ("steps:0,1,0,1", "HZ is 0, but must be positive;"),
            ("sine:1,2,5,-1", "SECONDS is -1, but must be positive;"),
            ("triangle:3,2,5,1", "LOW is 3, but must be below HIGH, 2;"),
        ] {
            let message = Shape::named(Path::new(text)).unwrap_err().text();
            assert!(message.contains(what) && message.contains("FORM:LOW,HIGH,HZ,SECONDS"), "{message}");
        }
        assert_eq!(Shape::named(Path::new("reference.csv")).unwrap(), None);
        let shape: Shape = "sine:0,1,1,1e9".parse().unwrap();
        shape.record(Path::new("x"), OutputUnit::Newton, 1000.0).unwrap_err();
    }
}
