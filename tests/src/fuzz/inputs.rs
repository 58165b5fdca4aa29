//! Everything that reads external files and parameters: controllers, models, records, logs, plants.

use std::sync::OnceLock;

use hyst_cli::log::{LoggedModel, LoggedSample, RunInfo, RunLog, recovered};
use hyst_core::{List, read_block};
use hyst_hw::wire::{Control, Follower, Shown, lateness, read_recipe};
use hyst_hw::{Phase, Plant, PlantConfig, Sample};
use hyst_ident::export::block;
use hyst_ident::model::Model;
use hyst_ident::record::{self, ColumnMap, Need, Record};

use super::random::Random;
use super::sealed::{recipe, reseal_block, reseal_recipe};
use crate::{PLANT, WARM, root};

/// Returns the models of the documentation, one of each kind.
fn models() -> &'static [String] {
    static MODELS: OnceLock<Vec<String>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let folder = root().join("docs").join("models");
        let files = std::fs::read_dir(&folder).expect("the models of the documentation");
        let mut paths: Vec<_> = files.filter_map(|file| Some(file.ok()?.path())).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "json"));
        paths.sort();
        let read = |path| std::fs::read_to_string(path).expect("a model");
        paths.into_iter().map(read).filter(|text| text.len() < 20_000).collect()
    })
}

/// Controllers, and a run with those that could be read.
pub(super) fn controllers(random: &mut Random) {
    let mut bytes = recipe().0.to_vec();
    match random.below(4) {
        0 => random.damage(&mut bytes),
        1 => bytes = random.bytes(200),
        _ => reseal_recipe(random, &mut bytes),
    }
    let period = *random.of(&[0.001f32, 0.002, 0.1, f32::NAN, 0.0, 1e-30, 1e30]);
    let _ = (read_recipe(&bytes), lateness(&bytes, period));
    let mut follower = Follower::new();
    if follower.load(&bytes) {
        let shown = Shown { output: 3.0, temperature_degc: 20.0, load_n: 0.0 };
        if follower.prepare(period, &shown, 20.0, true) {
            follower.begin(3.0, &shown, 20.0);
            for k in 0..20 {
                let _ = follower.step(3.0 + 0.1 * k as f32, &shown);
            }
            let _ = (follower.step(f32::NAN, &shown), follower.step(1e30, &shown), follower.due());
        }
    }
}

/// Parameter blocks of every kind of model.
pub(super) fn blocks(random: &mut Random) {
    static BLOCKS: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    let blocks = BLOCKS.get_or_init(|| {
        models().iter().filter_map(|text| block(&Model::parse("model.json", text).expect("a model")).ok()).collect()
    });
    let mut bytes = random.of(blocks).clone();
    if random.once_in(3) {
        random.damage(&mut bytes);
    } else {
        reseal_block(random, &mut bytes);
    }
    let _ = read_block::<List<64>, List<16>>(&bytes);
    let _ = read_block::<Vec<f64>, Vec<f64>>(&bytes);
}

/// Model files; a file that was read can be written and exported.
pub(super) fn model_files(random: &mut Random) {
    let mut text = random.of(models()).clone().into_bytes();
    random.damage(&mut text);
    let Ok(text) = String::from_utf8(text) else { return };
    if let Ok(model) = Model::parse("model.json", &text) {
        let _ = block(&model);
        Model::parse("again.json", &model.to_json()).expect("the written file can be read");
    }
}

/// Records as CSV.
pub(super) fn records(random: &mut Random) {
    let mut text = String::from("segment,time_s,voltage_v,displacement_um,temperature_degc\n");
    for k in 0..random.below(40) {
        text += &format!(
            "{},{},{:.3},{:e},22.5\n",
            k / 20,
            k as f64 * 0.002,
            random.between(0.0, 100.0),
            random.between(-5.0, 20.0)
        );
    }
    let mut bytes = text.into_bytes();
    random.damage(&mut bytes);
    if random.once_in(8) {
        bytes.splice(0..0, *b"\xef\xbb\xbf");
    }
    let need = *random.of(&[Need::InputAndOutput, Need::Input, Need::Output]);
    if let Ok(record) = Record::parse("a.csv", &bytes, &ColumnMap::default(), need) {
        assert!(record.time().iter().all(|t| t.is_finite()));
    }
}

/// Logs: read, converted, recovered.
pub(super) fn logs(random: &mut Random) {
    static LOG: OnceLock<Vec<u8>> = OnceLock::new();
    let log = LOG.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.mcap");
        let json = &models()[0];
        let model = Model::parse("model.json", json).expect("a model");
        let output = record::OutputUnit::Micrometre;
        let model = Some(LoggedModel { model: &model, json });
        let info = RunInfo { device: "fuzz", output, sample_rate_hz: 4.0, model };
        let mut log = RunLog::create(&path, &info).expect("a log");
        for k in 0..12 {
            let time_s = 0.25 * f64::from(k);
            let sample =
                Sample { time_s, drive_v: 1.5, output: 0.3, temperature_degc: Some(20.0), load_n: None, force_n: None };
            log.sample(&LoggedSample::new(0, Phase::Record, &sample, Some(0.25))).expect("it is written");
        }
        log.finish().expect("it is written");
        std::fs::read(path).expect("a log")
    });
    let mut bytes = log.clone();
    random.damage(&mut bytes);
    if let Ok(log) = record::RunLog::parse("run.mcap", &bytes) {
        let _ = log.csv("run.mcap", true);
    }
    if let Ok(whole) = recovered(&bytes) {
        // A log without its channel is not the log of a run.
        let _ = record::RunLog::parse("again.mcap", &whole).map(|log| assert!(!log.lost.cut_off));
    }
}

/// Sections of a plant description.
const SECTIONS: &str = "\
[creep]
strength = 0.05
tau_min_s = 0.05
tau_max_s = 80
[[mode]]
hz = 100
damping = 0.02
gain = 0.9
[saturation]
high_um = 12
[[disturbance]]
kind = \"slew-limit\"
v_per_s = 900
[[disturbance]]
kind = \"bursts\"
um = 0.1
seconds = 0.2
every_s = 3
";

/// Descriptions of simulated plants.
pub(super) fn plants(random: &mut Random) {
    let mut text = format!("{PLANT}{WARM}{SECTIONS}").into_bytes();
    random.damage(&mut text);
    let Ok(text) = String::from_utf8(text) else { return };
    if let Ok(config) = PlantConfig::from_toml(&text)
        && config.actuator.relays <= 2000
    {
        let _ = Plant::new(config);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Damage to an invalid description tests little.
    #[test]
    fn the_plant_is_valid_before_it_is_damaged() {
        let config = PlantConfig::from_toml(&format!("{PLANT}{WARM}{SECTIONS}")).unwrap();
        assert_eq!(config.disturbances.len(), 2);
        Plant::new(config).unwrap();
    }
}
