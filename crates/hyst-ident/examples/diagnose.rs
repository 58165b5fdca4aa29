//! Reads a record, fits a base model, diagnoses it and prints the findings:
//! `cargo run --release -p hyst-ident --example diagnose -- [RECORD]`.
//!
//! RECORD is a table of text with a time in s, an input in V and an output in µm. Without it, the example makes a record
//! of a simulated actuator: relays with irregular thresholds after a lag of 4 ms, in small steps. It shares no equations
//! with the models.

use std::error::Error;

use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::{ColumnMap, Columns, Need, OutputUnit, Record};

/// Sample rate of the simulated record \[Hz\].
const RATE_HZ: f64 = 500.0;
/// Time constant of the simulated amplifier \[s\].
const LAG_S: f64 = 0.004;
/// Integration steps per sample.
const STEPS: u32 = 20;
/// Highest voltage of the simulated record \[V\].
const TOP_V: f64 = 100.0;
/// Reversible gain of the simulated actuator \[µm/V\].
const GAIN_UM_PER_V: f64 = 0.12;
/// Output of all relays of the simulated actuator \[µm\].
const RELAYS_UM: f64 = 6.0;
/// Peak of the simulated sensor noise \[µm\].
const NOISE_UM: f64 = 0.01;

fn main() -> Result<(), Box<dyn Error>> {
    let record = match std::env::args().nth(1) {
        Some(path) => Record::read(path, &ColumnMap::default(), Need::InputAndOutput)?,
        None => simulated()?,
    };
    println!("record     {}: {} rows, {} segments", record.name(), record.rows(), record.segments().len());

    let model = fit(&record, Kind::Pi, &FitOptions::default())?;
    let found = diagnose(&record, None, &model, &DiagnoseOptions::default(), &|_| {})?;

    let findings = &found.findings;
    let unit = &findings.unit;
    if let (Some(before), Some(after)) = (findings.before.train, findings.after.train) {
        println!("RMSE       {:.4} {unit} before, {:.4} {unit} after the extension", before.rmse, after.rmse);
    }
    println!("noise      {:.4} {unit}", findings.noise_floor);
    for effect in &findings.effects {
        println!("effect     {}, probability {:.3}", effect.name.name(), effect.probability);
        for (name, parameter) in &effect.parameters {
            let error = parameter.std_error.map_or(String::new(), |error| format!(" ± {error:.2e}"));
            println!("           {name} = {:.4e}{error} {}", parameter.value, parameter.unit);
        }
        effect.evidence.iter().for_each(|sentence| println!("           {sentence}"));
    }
    if findings.effects.is_empty() {
        println!("effect     none");
    }
    println!("remainder  {}", findings.remainder.description);
    Ok(())
}

/// Returns a record of the simulated actuator.
fn simulated() -> Result<Record, Box<dyn Error>> {
    let limits = Limits { rate_hz: RATE_HZ, lo_v: 0.0, hi_v: TOP_V, slew_v_per_s: None };
    let drive = Identification::short(RATE_HZ, 1).drive(&limits)?;
    let mut segment = Vec::new();
    for (label, rows) in (0..).zip(drive.segments()) {
        segment.extend(rows.clone().map(|_| label));
    }
    let mut noise = Noise(1);
    let mut actuator = Actuator::new(&mut noise);
    let output = drive.voltage().iter().map(|v| actuator.step(*v) + NOISE_UM * noise.next()).collect();
    Ok(Record::from_samples(Columns {
        name: "simulated".into(),
        segment: Some(segment),
        time: drive.time().to_vec(),
        input: Some(drive.voltage().to_vec()),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    })?)
}

/// A reversible gain and a sum of relays, whose thresholds are irregular, after the lag `T du/dt = v − u`.
struct Actuator {
    v: f64,
    u: f64,
    relays: Vec<Relay>,
}

/// A relay: switches to `weight` \[µm\] when the input rises above `up` \[V\], and to 0 when it falls below `down` \[V\].
struct Relay {
    up: f64,
    down: f64,
    weight: f64,
    on: bool,
}

impl Actuator {
    fn new(noise: &mut Noise) -> Self {
        const LEVELS: u32 = 100;
        let mut relays = Vec::new();
        for i in 0..LEVELS {
            for j in 0..=i {
                let mut threshold =
                    |level: u32| TOP_V * (f64::from(level) + 0.5 + 0.5 * noise.next()) / f64::from(LEVELS);
                let (one, other) = (threshold(i), threshold(j));
                let (up, down) = (one.max(other), one.min(other));
                relays.push(Relay { up, down, weight: (-(up - down) / 30.0).exp(), on: false });
            }
        }
        let sum: f64 = relays.iter().map(|relay| relay.weight).sum();
        for relay in &mut relays {
            relay.weight *= RELAYS_UM / sum;
        }
        Self { v: 0.0, u: 0.0, relays }
    }

    /// Returns the output \[µm\] one sample later at the voltage `v`.
    fn step(&mut self, v: f64) -> f64 {
        let (from, dt) = (self.v, 1.0 / (RATE_HZ * f64::from(STEPS)));
        for k in 1..=STEPS {
            self.v = from + (v - from) * f64::from(k) / f64::from(STEPS);
            self.u += (self.v - self.u) * dt / LAG_S;
            for relay in &mut self.relays {
                relay.on = self.u > relay.up || (relay.on && self.u >= relay.down);
            }
        }
        GAIN_UM_PER_V * self.u + self.relays.iter().filter(|relay| relay.on).map(|relay| relay.weight).sum::<f64>()
    }
}

/// Repeatable noise: uniform between −1 and 1, from a linear congruential generator (Knuth's MMIX).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
