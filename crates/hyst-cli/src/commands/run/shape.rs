//! References without a file: sines, triangles and steps between two outputs.

use std::f64::consts::TAU;
use std::path::Path;
use std::str::FromStr;

use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::exit::{CommandError, CommandResult};

/// Longest reference \[rows\].
const MOST_ROWS: f64 = 1e8;

/// A reference as its arguments say it. It begins at its lower end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
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
}

/// Which of a shape's numbers is none or makes no sense.
fn wrong(text: &str) -> Option<String> {
    let (_, numbers) = text.split_once(':')?;
    let cells: Vec<&str> = numbers.split(',').map(str::trim).collect();
    if cells.len() != 4 {
        return Some(format!("there are {} numbers", cells.len()));
    }
    let of = |k: usize| cells[k].parse::<f64>().ok().filter(|x| x.is_finite());
    let names = ["LOW", "HIGH", "HZ", "SECONDS"];
    if let Some(k) = (0..4).find(|k| of(*k).is_none()) {
        return Some(format!("{} is \"{}\", no number", names[k], cells[k]));
    }
    match (2..4).find(|k| of(*k).is_some_and(|x| x <= 0.0)) {
        Some(k) => Some(format!("{} is {}, and has to be above zero", names[k], cells[k])),
        None => Some(format!("LOW is {}, and has to be below HIGH, {}", cells[0], cells[1])),
    }
}

/// Highest frequency, as a share of the rate: with fewer samples in a period a shape is another one.
const FASTEST: f64 = 0.1;

/// Steps from one end to the other.
const STEPS: f64 = 5.0;

impl FromStr for Shape {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (form, numbers) = text.split_once(':').ok_or(())?;
        let form = match form {
            "sine" => Form::Sine,
            "triangle" => Form::Triangle,
            "steps" => Form::Steps,
            _ => return Err(()),
        };
        let numbers: Vec<f64> = numbers.split(',').map(|n| n.trim().parse().map_err(drop)).collect::<Result<_, _>>()?;
        match numbers[..] {
            [low, high, hz, seconds]
                if low < high && low.is_finite() && high.is_finite() && hz > 0.0 && seconds > 0.0 =>
            {
                Ok(Self { form, low, high, hz, seconds })
            }
            _ => Err(()),
        }
    }
}

impl Shape {
    /// What `path` names, if it is a shape and no file.
    pub(super) fn named(path: &Path) -> CommandResult<Option<Self>> {
        let Some(text) = path.to_str().filter(|_| !path.exists()) else { return Ok(None) };
        let Some((form, _)) = text.split_once(':') else { return Ok(None) };
        if !["sine", "triangle", "steps"].contains(&form) {
            // Windows has drives of one letter.
            let word = form.len() > 1 && form.chars().all(|c| c.is_ascii_alphabetic());
            let message = format!(
                "{text}: there is no such file, and no form \"{form}\": give sine, triangle or steps, as sine:2,12,5,10"
            );
            return if word { Err(CommandError::bad_input(message)) } else { Ok(None) };
        }
        text.parse().map(Some).map_err(|()| {
            let wrong = wrong(text).map_or_else(String::new, |what| format!("; {what}"));
            CommandError::bad_input(format!("{text}: give FORM:LOW,HIGH,HZ,SECONDS, as sine:2,12,5,10{wrong}"))
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
        };
        self.low + (self.high - self.low) * share
    }

    /// As a record at `rate_hz`.
    pub(super) fn record(&self, path: &Path, unit: OutputUnit, rate_hz: f64) -> CommandResult<Record> {
        let rows = (self.seconds * rate_hz).round();
        if !(2.0..=MOST_ROWS).contains(&rows) {
            let message = format!(
                "{}: {} s at {rate_hz} Hz are {rows} rows; give another time or rate",
                path.display(),
                self.seconds
            );
            return Err(CommandError::bad_input(message));
        }
        if self.hz > FASTEST * rate_hz {
            let message = format!(
                "{}: {} Hz at {rate_hz} samples/s has fewer than {} samples a period; give a lower frequency, or a higher --rate where the device can",
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
        for form in ["sine", "triangle", "steps"] {
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
    fn what_is_no_shape_is_told_and_files_are_left_alone() {
        for text in [
            "sine:1,2,3",
            "sine:2,1,5,1",
            "steps:0,1,0,1",
            "triangle:0,1,1,x",
            "sine:0,1,1,1,1",
            "sine:0,inf,1,1",
            "sine:0,1,1,1,",
            "sine:0,1,1,1,x",
        ] {
            let message = Shape::named(Path::new(text)).unwrap_err();
            assert!(format!("{message:?}").contains("FORM:LOW,HIGH,HZ,SECONDS"), "{message:?}");
        }
        for (text, what) in [
            ("sine:1,2,3", "there are 3 numbers"),
            ("sine:1,2,x,3", "HZ is \"x\", no number"),
            ("steps:1,inf,2,3", "HIGH is \"inf\", no number"),
            ("sine:1,2,5,-1", "SECONDS is -1, and has to be above zero"),
            ("triangle:3,2,5,1", "LOW is 3, and has to be below HIGH, 2"),
        ] {
            assert_eq!(wrong(text).unwrap(), what);
        }
        assert_eq!(Shape::named(Path::new("reference.csv")).unwrap(), None);
        let shape: Shape = "sine:0,1,1,1e9".parse().unwrap();
        shape.record(Path::new("x"), OutputUnit::Newton, 1000.0).unwrap_err();
    }
}
