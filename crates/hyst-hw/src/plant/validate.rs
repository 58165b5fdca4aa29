//! Checks of a plant's description, with a message for each invalid value.

use super::config::{
    Actuator, Asymmetry, Creep, Disturbance, Load, Mode, PlantConfig, Saturation, Sensor, Temperature,
};
use super::error::ConfigError;

type Checked = Result<(), ConfigError>;

/// Returns an error unless `value` is finite and `fits` is true.
fn demand(field: &str, value: f64, fits: bool, advice: &str) -> Checked {
    if value.is_finite() && fits { Ok(()) } else { Err(ConfigError::value(field, value, advice)) }
}

fn within(field: &str, value: f64, low: f64, high: f64, what: &str) -> Checked {
    let fits = (low..=high).contains(&value);
    demand(field, value, fits, &format!("give {what} from {low} to {high}"))
}

fn count_within(field: &str, value: usize, low: usize, high: usize, what: &str) -> Checked {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(ConfigError::value(field, value, format!("give {what} from {low} to {high}")))
    }
}

impl PlantConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// On the first invalid value, with its field and what to give instead.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (field, seed) in [("seed", Some(self.seed)), ("noise_seed", self.noise_seed)] {
            if let Some(seed) = seed.filter(|seed| i64::try_from(*seed).is_err()) {
                return Err(ConfigError::value(field, seed, format!("give an integer from 0 to {}", i64::MAX)));
            }
        }
        actuator(&self.actuator)?;
        sensor(&self.sensor)?;
        if let Some(viscosity) = &self.viscosity {
            let advice = "give a drag from 1e-7 to 1 V s, or remove the section [viscosity]";
            let fits = (1e-7..=1.0).contains(&viscosity.volt_seconds);
            demand("viscosity.volt_seconds", viscosity.volt_seconds, fits, advice)?;
        }
        if let Some(delay) = &self.delay {
            let fits = delay.seconds > 0.0 && delay.seconds <= 1.0;
            let advice = "give a dead time above 0 and up to 1 s, or remove the section [delay]";
            demand("delay.seconds", delay.seconds, fits, advice)?;
        }
        if let Some(lag) = &self.lag {
            let advice = "give a time constant from 1e-5 to 10 s, or remove the section [lag]";
            demand("lag.seconds", lag.seconds, (1e-5..=10.0).contains(&lag.seconds), advice)?;
        }
        if let Some(section) = &self.asymmetry {
            asymmetry(section)?;
        }
        if let Some(section) = &self.temperature {
            temperature(section)?;
        }
        if let Some(section) = &self.creep {
            creep(section)?;
        }
        if let Some(section) = &self.load {
            load(section)?;
        }
        modes(&self.modes)?;
        if let Some(section) = &self.saturation {
            saturation(section, self.actuator.rest_v)?;
        }
        if let Some(drift) = &self.drift {
            let advice = "give a rate in um/s that is not 0, or remove the section [drift]";
            demand("drift.um_per_s", drift.um_per_s, drift.um_per_s != 0.0, advice)?;
        }
        if let Some(wave) = &self.interference {
            let advice = "give an amplitude in um above 0, or remove the section [interference]";
            demand("interference.amplitude_um", wave.amplitude_um, wave.amplitude_um > 0.0, advice)?;
            demand("interference.hz", wave.hz, wave.hz > 0.0, "give a frequency in Hz above 0")?;
            demand("interference.phase_rad", wave.phase_rad, true, "give a finite phase in rad")?;
        }
        disturbances(self)
    }
}

fn actuator(a: &Actuator) -> Checked {
    demand("actuator.min_v", a.min_v, true, "give a finite voltage")?;
    demand("actuator.max_v", a.max_v, a.max_v > a.min_v, "give a finite voltage above actuator.min_v")?;
    let rest_fits = (a.min_v..=a.max_v).contains(&a.rest_v);
    demand("actuator.rest_v", a.rest_v, rest_fits, "give a voltage from actuator.min_v to actuator.max_v")?;
    demand("actuator.gain_um_per_v", a.gain_um_per_v, a.gain_um_per_v > 0.0, "give a gain in um/V above 0")?;
    within("actuator.loop_share", a.loop_share, 0.0, 0.3, "the largest opening of the loop as a share of its span")?;
    count_within("actuator.relays", a.relays, 1000, 500_000, "a number of relays (or plays)")
}

fn sensor(s: &Sensor) -> Checked {
    let [low, high] = s.range_um;
    demand("sensor.range_um[0]", low, true, "give a finite displacement in um")?;
    demand("sensor.range_um[1]", high, high > low, "give a finite displacement in um above range_um[0]")?;
    count_within("sensor.bits", s.bits as usize, 4, 48, "a resolution in bit")?;
    demand("sensor.noise_um", s.noise_um, s.noise_um >= 0.0, "give a standard deviation in um, 0 or more")?;
    let shown = low < s.offset_um && s.offset_um < high;
    demand("sensor.offset_um", s.offset_um, shown, "give a reading at rest within sensor.range_um")?;
    within("sensor.max_rate_hz", s.max_rate_hz, 1.0, 1e6, "a sample rate in Hz")
}

fn asymmetry(a: &Asymmetry) -> Checked {
    // Within these limits the curve increases everywhere, also beyond the stroke.
    within("asymmetry.bend", a.bend, -1.0, 1.0, "a difference of slope over the mean slope")?;
    within("asymmetry.hook", a.hook, -0.5, 0.5, "a difference of slope over the mean slope")?;
    let advice = "give a difference of slope that is not 0 (or asymmetry.hook), or remove the section [asymmetry]";
    demand("asymmetry.bend", a.bend, a.bend != 0.0 || a.hook != 0.0, advice)
}

fn temperature(t: &Temperature) -> Checked {
    within("temperature.per_k", t.per_k, -0.1, 0.1, "a relative change per kelvin")?;
    within("temperature.reference_degc", t.reference_degc, -273.15, 1000.0, "a temperature in degC")?;
    within("temperature.mean_degc", t.mean_degc, -273.15, 1000.0, "a temperature in degC")?;
    within("temperature.swing_k", t.swing_k, 0.0, 500.0, "a swing in K")?;
    match t.period_s {
        Some(period) => demand("temperature.period_s", period, period >= 0.1, "give a period of 0.1 s or more")?,
        None if t.swing_k > 0.0 => {
            let advice = "a swing needs temperature.period_s: give a period in s, or remove temperature.swing_k";
            return Err(ConfigError::value("temperature.swing_k", t.swing_k, advice));
        }
        None => {}
    }
    demand("temperature.noise_k", t.noise_k, t.noise_k >= 0.0, "give a standard deviation in K, 0 or more")?;
    if t.per_k == 0.0 && !t.recorded {
        let advice =
            "a temperature that is not recorded must have an effect: give temperature.per_k, or remove [temperature]";
        return Err(ConfigError::value("temperature.recorded", false, advice));
    }
    Ok(())
}

fn creep(c: &Creep) -> Checked {
    let fits = c.strength > 0.0 && c.strength <= 1.0;
    demand("creep.strength", c.strength, fits, "give a share above 0 and up to 1, or remove the section [creep]")?;
    within("creep.tau_min_s", c.tau_min_s, 1e-3, 1e5, "a time constant in s")?;
    let above = c.tau_max_s > c.tau_min_s && c.tau_max_s <= 1e6;
    demand("creep.tau_max_s", c.tau_max_s, above, "give a time constant in s above creep.tau_min_s, up to 1e6")?;
    within("creep.exponent", c.exponent, -2.0, 2.0, "a power")?;
    count_within("creep.elements", c.elements, 2, 1000, "a number of time constants")
}

fn load(l: &Load) -> Checked {
    demand("load.newtons", l.newtons, l.newtons > 0.0, "give an amplitude in N above 0, or remove the section [load]")?;
    let advice = "give a compliance in um/N that is not 0, or remove the section [load]";
    demand("load.um_per_n", l.um_per_n, l.um_per_n != 0.0, advice)?;
    demand("load.period_s", l.period_s, l.period_s >= 0.1, "give a period of 0.1 s or more")?;
    demand("load.noise_n", l.noise_n, l.noise_n >= 0.0, "give a standard deviation in N, 0 or more")
}

fn modes(modes: &[Mode]) -> Checked {
    for (index, mode) in modes.iter().enumerate() {
        let name = |field: &str| format!("mode[{index}].{field}");
        within(&name("hz"), mode.hz, 0.1, 20_000.0, "a natural frequency in Hz")?;
        let damped = mode.damping > 0.0 && mode.damping < 1.0;
        demand(&name("damping"), mode.damping, damped, "give a damping ratio between 0 and 1, both excluded")?;
        let useful = mode.gain != 0.0 && mode.gain.abs() <= 10.0;
        demand(&name("gain"), mode.gain, useful, "give a share that is not 0, or remove this [[mode]]")?;
    }
    let sum: f64 = modes.iter().map(|mode| mode.gain).sum();
    // The tolerance allows for the rounding of decimal shares.
    demand("mode[].gain (sum)", sum, sum <= 1.0 + 1e-9, "give gains of all [[mode]] with a sum of 1 or less")
}

fn saturation(s: &Saturation, rest_v: f64) -> Checked {
    if [s.low_um, s.high_um, s.low_v, s.high_v].iter().all(Option::is_none) {
        let advice = "give saturation.low_um, high_um, low_v or high_v, or remove the section [saturation]";
        return Err(ConfigError::value("saturation.high_um", "none", advice));
    }
    let advice = "give a length in um, 0 or more, or remove knee_um";
    demand("saturation.knee_um", s.knee_um, s.knee_um >= 0.0, advice)?;
    demand("saturation.low_um", s.low_um.unwrap_or(0.0), true, "give a finite displacement in um")?;
    let room = s.low_um.map_or(f64::NEG_INFINITY, |low| low + 2.0 * s.knee_um);
    let advice = "give a displacement in um above saturation.low_um, with room for both knees";
    s.high_um.map_or(Ok(()), |high| demand("saturation.high_um", high, high > room, advice))?;
    // The actuator rests at actuator.rest_v, which the amplifier must be able to give.
    let advice = "give a voltage of at most actuator.rest_v";
    s.low_v.map_or(Ok(()), |low| demand("saturation.low_v", low, low <= rest_v, advice))?;
    let advice = "give a voltage of at least actuator.rest_v, above saturation.low_v";
    let least = |high: f64| high >= rest_v && s.low_v.is_none_or(|low| high > low);
    s.high_v.map_or(Ok(()), |high| demand("saturation.high_v", high, least(high), advice))
}

fn disturbances(config: &PlantConfig) -> Checked {
    for (index, disturbance) in config.disturbances.iter().enumerate() {
        let is = |field: &str, value: f64, fits: bool, advice: &str| {
            demand(&format!("disturbance[{index}].{field}"), value, fits, &format!("give {advice}"))
        };
        match *disturbance {
            Disturbance::Jump { um, at_s } => {
                is("um", um, um != 0.0, "a jump in um that is not 0, or remove this [[disturbance]]")?;
                is("at_s", at_s, at_s >= 0.0, "a time on the lab clock in s, 0 or more")?;
            }
            Disturbance::GainStep { share, at_s } => {
                let fits = share != 0.0 && (-0.9..=9.0).contains(&share);
                is(
                    "share",
                    share,
                    fits,
                    "a relative change from -0.9 to 9 that is not 0, or remove this [[disturbance]]",
                )?;
                is("at_s", at_s, at_s >= 0.0, "a time on the lab clock in s, 0 or more")?;
            }
            Disturbance::Bursts { um, seconds, every_s } => {
                is("um", um, um > 0.0, "a standard deviation in um above 0")?;
                is("seconds", seconds, seconds > 0.0, "a duration in s above 0")?;
                is("every_s", every_s, every_s > seconds, "an interval in s that is longer than disturbance.seconds")?;
            }
            Disturbance::Wander { um, period_s } => {
                is("um", um, um > 0.0, "an amplitude in um above 0")?;
                is("period_s", period_s, period_s >= 0.1, "a period of 0.1 s or more")?;
            }
            Disturbance::Slip { um, at_v } => {
                is("um", um, um > 0.0, "a distance in um above 0")?;
                let passed = config.actuator.min_v < at_v && at_v <= config.actuator.max_v;
                is("at_v", at_v, passed, "a voltage above actuator.min_v, up to actuator.max_v")?;
            }
            Disturbance::SlewLimit { v_per_s } => is("v_per_s", v_per_s, v_per_s > 0.0, "a slope in V/s above 0")?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::config::tests::clean;
    use super::super::config::{Delay, Drift, Interference, Lag, LoadShape, TemperatureShape};
    use super::*;

    fn assert_invalid(field: &str, change: impl FnOnce(&mut PlantConfig)) {
        let mut config = clean();
        change(&mut config);
        match config.validate() {
            Err(ConfigError::Value { field: named, advice, .. }) => {
                assert_eq!(named, field);
                assert!(!advice.is_empty());
            }
            other => panic!("{field}: {other:?}"),
        }
        assert!(config.to_toml().is_err(), "{field}: written although invalid");
    }

    fn warm() -> Temperature {
        Temperature {
            per_k: 0.005,
            reference_degc: 22.0,
            mean_degc: 22.0,
            swing_k: 0.0,
            period_s: None,
            shape: TemperatureShape::Sine,
            recorded: true,
            noise_k: 0.0,
        }
    }

    #[test]
    fn errors_contain_the_field() {
        clean().validate().unwrap();
        assert_invalid("seed", |c| c.seed = u64::MAX);
        assert_invalid("noise_seed", |c| c.noise_seed = Some(u64::MAX));
        assert_invalid("actuator.max_v", |c| c.actuator.max_v = c.actuator.min_v);
        assert_invalid("actuator.rest_v", |c| c.actuator.rest_v = -1.0);
        assert_invalid("actuator.gain_um_per_v", |c| {
            c.actuator.gain_um_per_v = f64::NAN;
        });
        assert_invalid("actuator.loop_share", |c| c.actuator.loop_share = 0.9);
        assert_invalid("actuator.relays", |c| c.actuator.relays = 3);
        assert_invalid("sensor.range_um[1]", |c| c.sensor.range_um = [5.0, 5.0]);
        assert_invalid("sensor.offset_um", |c| c.sensor.offset_um = 100.0);
        assert_invalid("sensor.bits", |c| c.sensor.bits = 1);
        assert_invalid("sensor.noise_um", |c| c.sensor.noise_um = -1.0);
        assert_invalid("delay.seconds", |c| c.delay = Some(Delay { seconds: 0.0 }));
        assert_invalid("lag.seconds", |c| {
            c.lag = Some(Lag { seconds: f64::INFINITY });
        });
        assert_invalid("asymmetry.bend", |c| c.asymmetry = Some(Asymmetry { bend: 0.0, hook: 0.0 }));
        assert_invalid("asymmetry.hook", |c| c.asymmetry = Some(Asymmetry { bend: 0.1, hook: 0.6 }));
        assert_invalid("drift.um_per_s", |c| {
            c.drift = Some(Drift { um_per_s: 0.0 });
        });
        assert_invalid("interference.hz", |c| {
            c.interference = Some(Interference { amplitude_um: 1.0, hz: 0.0, phase_rad: 0.0 });
        });
        assert_invalid("temperature.swing_k", |c| {
            c.temperature = Some(Temperature { swing_k: 3.0, ..warm() });
        });
        assert_invalid("temperature.recorded", |c| {
            c.temperature = Some(Temperature { per_k: 0.0, recorded: false, ..warm() });
        });
        assert_invalid("creep.tau_max_s", |c| {
            c.creep = Some(Creep { strength: 0.1, tau_min_s: 1.0, tau_max_s: 0.5, exponent: 0.0, elements: 60 });
        });
        let load = |newtons, um_per_n, period_s| {
            Some(Load { newtons, um_per_n, period_s, shape: LoadShape::Sine, recorded: true, noise_n: 0.0 })
        };
        assert_invalid("load.newtons", |c| c.load = load(0.0, 0.1, 1.0));
        assert_invalid("load.um_per_n", |c| c.load = load(1.0, 0.0, 1.0));
        assert_invalid("load.period_s", |c| c.load = load(1.0, 0.1, 0.0));
        assert_invalid("mode[1].damping", |c| {
            c.modes = vec![Mode { hz: 100.0, damping: 0.1, gain: 0.5 }, Mode { hz: 300.0, damping: 0.0, gain: 0.5 }];
        });
        let stops = |low_um, high_um, knee_um| Some(Saturation { low_um, high_um, knee_um, ..Default::default() });
        assert_invalid("saturation.high_um", |c| c.saturation = stops(None, None, 0.0));
        assert_invalid("saturation.high_um", |c| c.saturation = stops(Some(2.0), Some(3.0), 0.5));
        assert_invalid("saturation.low_um", |c| c.saturation = stops(Some(f64::NAN), None, 0.0));
        assert_invalid("saturation.knee_um", |c| c.saturation = stops(None, Some(3.0), -1.0));
        let rails = |low_v, high_v| Some(Saturation { low_v, high_v, ..Default::default() });
        assert_invalid("saturation.low_v", |c| c.saturation = rails(Some(1.0 + c.actuator.rest_v), None));
        assert_invalid("saturation.high_v", |c| c.saturation = rails(None, Some(c.actuator.rest_v - 1.0)));
        assert_invalid("saturation.high_v", |c| c.saturation = rails(Some(c.actuator.rest_v), Some(c.actuator.rest_v)));
        assert_invalid("disturbance[0].um", |c| c.disturbances = vec![Disturbance::Jump { um: 0.0, at_s: 1.0 }]);
        assert_invalid("disturbance[1].at_s", |c| {
            c.disturbances = [1.0, -1.0].map(|at_s| Disturbance::GainStep { share: 0.1, at_s }).to_vec();
        });
        assert_invalid("disturbance[0].every_s", |c| {
            c.disturbances = vec![Disturbance::Bursts { um: 0.1, seconds: 0.3, every_s: 0.2 }];
        });
        assert_invalid("disturbance[0].period_s", |c| {
            c.disturbances = vec![Disturbance::Wander { um: 0.1, period_s: f64::NAN }];
        });
        assert_invalid("disturbance[0].at_v", |c| c.disturbances = vec![Disturbance::Slip { um: 0.1, at_v: 0.0 }]);
        assert_invalid("mode[].gain (sum)", |c| {
            c.modes = vec![Mode { hz: 100.0, damping: 0.1, gain: 0.7 }; 2];
        });
    }
}
