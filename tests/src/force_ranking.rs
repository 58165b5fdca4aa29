//! A random force on a simulated actuator, found by `hystctl force` through four models of the free one: IFM, LFDM and Bouc-Wen, as Zhu et
//! al. compared them, and a chain that a diagnosis has extended.

use serde_json::Value;

use crate::Lab;

/// Compliance of the actuator's end \[µm/N\], and so the stiffness that the force works against \[N/µm\].
const UM_PER_N: f64 = 0.5;

/// One model as the free one.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// Its kind, with the effects of the extended chain.
    pub name: String,
    /// Of the free actuator on a record of its own \[µm\].
    pub free_rmse: f64,
    /// Gain and zero \[µm\] by which the free displacement is corrected.
    pub affine: (f64, f64),
    /// Root mean square of the force's error \[N\].
    pub rmse: f64,
    /// The largest one \[N\].
    pub max: f64,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// Best first.
    pub models: Vec<Ranked>,
    /// Root mean square of the force \[N\].
    pub force: f64,
}

/// An actuator of random relays with viscous walls, a lag and creep.
fn plant(seed: u64) -> String {
    format!(
        "seed = {seed}\n\
         [actuator]\nmax_v = 100\ngain_um_per_v = 0.2\nloop_share = 0.13\nrelays = 4000\n\
         [sensor]\nrange_um = [-10, 40]\nnoise_um = 0.004\n\
         [lag]\nseconds = 0.003\n\
         [creep]\nstrength = 0.05\ntau_min_s = 0.05\ntau_max_s = 20.0\n"
    )
}

/// Runs the study on the actuator of a seed, with so many evaluations of a searched model.
///
/// # Panics
/// When a command fails.
pub fn run(seed: u64, evaluations: u32) -> Ranking {
    let lab = Lab::new();
    lab.write("free.toml", plant(seed));
    let load =
        format!("[load]\nnewtons = 4.0\num_per_n = {UM_PER_N}\nperiod_s = 1.3\nshape = \"wander\"\nrecorded = true\n");
    lab.write("loaded.toml", format!("{}{load}", plant(seed)));
    let drive = "excite identification --rate 500 --high 100 --seconds 16 --slow 4 --hold 2 --rest 0.5";
    lab.ok(&format!("{drive} --seed {seed} -o u.csv"));
    lab.ok(&format!("{drive} --seed {seed} --test -o u-test.csv"));
    lab.ok("run --daq sim:free.toml --drive u.csv --record train.csv");
    lab.ok("run --daq sim:free.toml --drive u-test.csv --record test.csv --seed 2");
    lab.ok("run --daq sim:loaded.toml --drive u-test.csv --record loaded.csv --seed 3");
    for kind in ["ifm", "lfdm", "bouc-wen"] {
        lab.ok(&format!("fit train.csv --model {kind} --seed {seed} --evaluations {evaluations} -o {kind}.json"));
    }
    lab.ok("fit train.csv --model pi -o pi.json");
    let said = lab.ok("diagnose train.csv --model pi.json -o extended.json --findings findings.json --json").json();
    let effects: Vec<&str> =
        said["effects"].as_array().into_iter().flatten().filter_map(|effect| effect["name"].as_str()).collect();
    let extended = format!("pi + {}", effects.join(" + "));
    let number = |said: &Value, path: &str| {
        said.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} is missing in {said}"))
    };
    let ranked = |(file, name): (&str, &str)| {
        let free = lab.ok(&format!("simulate --model {file}.json test.csv -o simulated.csv --json")).json();
        let stiffness = 1.0 / UM_PER_N;
        let line =
            format!("force --model {file}.json loaded.csv --kout {stiffness} --free train.csv -o force.csv --json");
        let said = lab.ok(&line).json();
        Ranked {
            name: name.to_owned(),
            free_rmse: number(&free, "/errors/rmse"),
            affine: (number(&said, "/kappa"), number(&said, "/chi")),
            rmse: number(&said, "/errors/rmse"),
            max: number(&said, "/errors/max_abs"),
        }
    };
    let asked = [("ifm", "ifm"), ("lfdm", "lfdm"), ("bouc-wen", "bouc-wen"), ("pi", "pi"), ("extended", &extended)];
    let mut models: Vec<Ranked> = asked.map(ranked).into();
    models.sort_by(|a, b| a.rmse.total_cmp(&b.rmse));
    let load = crate::column(&lab.read("loaded.csv"), "load_n");
    let force = (load.iter().map(|f| f * f).sum::<f64>() / load.len() as f64).sqrt();
    Ranking { models, force }
}
