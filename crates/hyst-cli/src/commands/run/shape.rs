//! References without a file: sines, triangles, steps and what scanners ask for, between two outputs.

use std::f64::consts::TAU;
use std::path::Path;
use std::str::FromStr;

use hyst_ident::excite::{Raster, Spiral};
use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::exit::{CommandError, CommandResult};

/// Longest reference \[rows\].
const MOST_ROWS: f64 = 1e8;

/// A reference as its arguments say it. It begins at its lower end, but for spirals and the sines of Lissajous patterns, which begin in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::commands) struct Shape {
    form: Form,
    low: f64,
    high: f64,
    /// Frequency of a sine or triangle, or of passing all of the steps up and down \[Hz\].
    hz: f64,
    seconds: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Sine,
    Triangle,
    Steps,
    /// Lines with rounded turnings.
    Raster,
    /// One axis of a spiral, from the middle to the rim, and the other one.
    Spiral,
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

/// Share of a raster's time that its turnings take.
const TURNING: f64 = 0.2;

/// Highest frequency, as a share of the rate: with fewer samples in a period a shape is another one.
const FASTEST: f64 = 0.1;

/// Steps from one end to the other.
const STEPS: f64 = 5.0;

impl FromStr for Shape {
    /// What makes no sense.
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (form, numbers) = text.split_once(':').ok_or("there is no colon")?;
        let form = Form::named(form).ok_or_else(|| format!("there is no form \"{form}\""))?;
        let cells: Vec<&str> = numbers.split(',').map(str::trim).collect();
        let &[low, high, hz, seconds] = &cells[..] else {
            let many = if numbers.is_empty() { 0 } else { cells.len() };
            return Err(format!("four numbers have to follow, not {many}"));
        };
        let number = |name: &str, cell: &str| {
            let x = cell.parse::<f64>().ok().filter(|x| x.is_finite());
            x.ok_or_else(|| format!("{name} is \"{cell}\", no finite number"))
        };
        let positive = |name: &str, cell: &str| match number(name, cell)? {
            x if x > 0.0 => Ok(x),
            x => Err(format!("{name} is {x}, and has to be above zero")),
        };
        let (low, high) = (number("LOW", low)?, number("HIGH", high)?);
        if low >= high {
            return Err(format!("LOW is {low}, and has to be below HIGH, {high}"));
        }
        Ok(Self { form, low, high, hz: positive("HZ", hz)?, seconds: positive("SECONDS", seconds)? })
    }
}

impl Shape {
    /// What `path` names, if it is a shape and no file.
    pub(in crate::commands) fn named(path: &Path) -> CommandResult<Option<Self>> {
        let Some(text) = path.to_str().filter(|_| !path.exists()) else { return Ok(None) };
        let Some((form, _)) = text.split_once(':') else { return Ok(None) };
        if Form::named(form).is_none() {
            // Windows has drives of one letter.
            let word = form.len() > 1 && form.chars().all(|c| c.is_ascii_alphabetic() || c == '-');
            let names: Vec<&str> = Form::ALL.iter().map(|(name, _)| *name).collect();
            let message = format!(
                "{text}: there is no such file, and no form \"{form}\": give one of {}, as sine:2,12,5,10",
                names.join(", ")
            );
            return if word { Err(CommandError::bad_input(message)) } else { Ok(None) };
        }
        text.parse().map(Some).map_err(|wrong: String| {
            CommandError::bad_input(format!("{text}: {wrong}; give FORM:LOW,HIGH,HZ,SECONDS, as sine:2,12,5,10"))
        })
    }

    /// Its value at a time \[s\].
    fn at(&self, t: f64) -> f64 {
        let phase = (t * self.hz).fract();
        let up = 1.0 - (2.0 * phase - 1.0).abs();
        let share = match self.form {
            Form::Sine => 0.5 - 0.5 * (TAU * phase).cos(),
            Form::Triangle => up,
            Form::Steps => (STEPS * up).round() / STEPS,
            Form::Raster => Raster::position(phase, TURNING),
            Form::Spiral => Spiral::position(t / self.seconds, t * self.hz, 0.0),
            Form::SpiralY => Spiral::position(t / self.seconds, t * self.hz, 90.0),
            Form::Lissajous => 0.5 + 0.5 * (TAU * phase).sin(),
        };
        self.low + (self.high - self.low) * share
    }

    /// As a record at `rate_hz`.
    pub(in crate::commands) fn record(&self, path: &Path, unit: OutputUnit, rate_hz: f64) -> CommandResult<Record> {
        let rows = (self.seconds * rate_hz).round();
        if !(2.0..=MOST_ROWS).contains(&rows) {
            let message =
                format!("{}: {} s at {rate_hz} Hz are {rows} rows; give another time", path.display(), self.seconds);
            return Err(CommandError::bad_input(message));
        }
        if self.hz > FASTEST * rate_hz {
            let message = format!(
                "{}: {} Hz at {rate_hz} samples/s has fewer than {} samples a period; give a lower frequency, or, to run, a higher --rate where the device can",
                path.display(),
                self.hz,
                1.0 / FASTEST
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
    fn shapes_begin_at_their_lower_end_and_reach_the_upper_one() {
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
    fn what_scanners_ask_for_has_its_speed_and_its_radius() {
        let of = |form: &str| {
            let path = format!("{form}:2,12,5,1");
            let shape = Shape::named(Path::new(&path)).unwrap().unwrap();
            shape.record(Path::new(&path), OutputUnit::Micrometre, 1000.0).unwrap().output().unwrap().to_vec()
        };
        // 10 % of each line's time is a turning at either end; constant speed is 100 µm/s over 0.9 then.
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
    fn what_is_no_shape_is_told_and_files_are_left_alone() {
        for (text, what) in [
            ("sine:1,2,3", "follow, not 3;"),
            ("sine:", "follow, not 0;"),
            ("sine:0,1,1,1,", "follow, not 5;"),
            ("sine:1,2,x,3", "HZ is \"x\", no finite number;"),
            ("sine:0,1,1,inf", "SECONDS is \"inf\", no finite number;"),
            ("steps:1,inf,2,3", "HIGH is \"inf\", no finite number;"),
            ("steps:0,1,0,1", "HZ is 0, and has to be above zero;"),
            ("sine:1,2,5,-1", "SECONDS is -1, and has to be above zero;"),
            ("triangle:3,2,5,1", "LOW is 3, and has to be below HIGH, 2;"),
        ] {
            let message = Shape::named(Path::new(text)).unwrap_err().text();
            assert!(message.contains(what) && message.contains("FORM:LOW,HIGH,HZ,SECONDS"), "{message}");
        }
        assert_eq!(Shape::named(Path::new("reference.csv")).unwrap(), None);
        let shape: Shape = "sine:0,1,1,1e9".parse().unwrap();
        shape.record(Path::new("x"), OutputUnit::Newton, 1000.0).unwrap_err();
    }
}
