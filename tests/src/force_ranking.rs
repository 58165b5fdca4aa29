//! A random force on a simulated actuator, estimated by `hystctl force` with several models of the free actuator: IFM,
//! LFDM and Bouc-Wen (compared by Zhu et al.), PI, and a PI chain extended by a diagnosis.

use serde_json::Value;

use crate::Lab;

/// Compliance of the actuator's end \[µm/N\]; its inverse is the stiffness \[N/µm\].
const UM_PER_N: f64 = 0.5;

/// Errors of one model of the free actuator.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// Kind, with the effects of the extended chain.
    pub name: String,
    /// RMSE of the free displacement on a test record \[µm\].
    pub free_rmse: f64,
    /// Gain κ and zero χ \[µm\] that correct the free displacement.
    pub affine: (f64, f64),
    /// RMS error of the force \[N\].
    pub rmse: f64,
    /// Largest error of the force \[N\].
    pub max: f64,
}

/// Result of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// Models, the best first.
    pub models: Vec<Ranked>,
    /// Root mean square of the force \[N\].
    pub force: f64,
}

/// Returns the description of an actuator of random relays, with a lag and creep.
fn plant(seed: u64) -> String {
    format!(
        "seed = {seed}\n\
         [actuator]\nmax_v = 100\ngain_um_per_v = 0.2\nloop_share = 0.13\nrelays = 4000\n\
         [sensor]\nrange_um = [-10, 40]\nnoise_um = 0.004\n\
         [lag]\nseconds = 0.003\n\
         [creep]\nstrength = 0.05\ntau_min_s = 0.05\ntau_max_s = 20.0\n"
    )
}

/// Runs the comparison on the actuator of a seed; `evaluations` is the budget of the searched models.
///
/// # Panics
/// If a command fails.
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
