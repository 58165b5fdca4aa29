//! Unusable model files: every command reports the error and writes nothing.

use hyst_tests::Lab;

/// Asserts that every command that reads a model rejects this one with a message that contains all of `parts`.
#[track_caller]
fn rejected(lab: &Lab, content: &str, parts: &[&str]) {
    lab.write("bad.json", content);
    for line in [
        "simulate --model bad.json train.csv -o out.csv",
        "simulate --model bad.json train.csv",
        "diagnose train.csv --model bad.json -o out.json --findings findings.json",
        "compensate --model bad.json reference.csv -o drive.csv",
        "run --daq sim:plant.toml --model bad.json --reference reference.csv --log run.mcap --record out.csv",
    ] {
        let message = lab.fails(line, 2);
        for part in parts.iter().chain(&["bad.json"]) {
            assert!(message.contains(part), "\"{part}\" is missing in: {message}");
        }
    }
}

fn lab() -> Lab {
    let lab = Lab::with_model();
    lab.reference("reference.csv", 1.0, 12.0);
    lab
}

#[test]
fn files_that_are_not_models_are_rejected() {
    let lab = lab();
    let model = lab.read("model.json");
    rejected(&lab, "", &["truncated"]);
    rejected(&lab, &model[..model.len() / 2], &["line", "column", "truncated"]);
    rejected(&lab, &model[..model.len() - 3], &["truncated"]);
    rejected(&lab, "time_s,voltage_v\n0,1\n", &["line 1"]);
    rejected(&lab, "[1, 2]", &["bad.json"]);
    rejected(&lab, "{}", &["hyst.model/1"]);
}

#[test]
fn another_schema_is_rejected() {
    let lab = lab();
    let model = lab.read("model.json");
    rejected(&lab, &model.replace("hyst.model/1", "hyst.model/2"), &["hyst.model/2", "update hystctl"]);
    rejected(&lab, &model.replace("hyst.model/1", "hyst.findings/1"), &["hyst.findings/1", "model.json"]);
}

#[test]
fn parameters_that_are_not_numbers_are_rejected() {
    let lab = lab();
    let model = lab.read("model.json");
    let gain = model.lines().find(|line| line.trim_start().starts_with("\"gain\": ") && !line.contains('V')).unwrap();
    rejected(&lab, &model.replace(gain, "      \"gain\": null,"), &["stage pi", "field gain"]);
    rejected(&lab, &model.replace(gain, "      \"gain\": NaN,"), &["line"]);
    rejected(&lab, &model.replace(gain, "      \"gain\": 1e999,"), &["line"]);
    rejected(&lab, &model.replace(gain, "      \"gain\": \"high\","), &["stage pi", "field gain"]);
    let zero = model.lines().find(|line| line.trim_start().starts_with("\"zero\": ")).unwrap();
    rejected(&lab, &model.replace(zero, "  \"zero\": null,"), &["line"]);
}

#[test]
fn stages_without_a_valid_chain_are_rejected() {
    let lab = lab();
    let model = lab.read("model.json");
    let list = model.find("\"stages\"").unwrap();
    rejected(&lab, &format!("{}\"stages\": []\n}}\n", &model[..list]), &["no hysteresis stage"]);
    rejected(&lab, &model.replace("\"kind\": \"pi\"", "\"kind\": \"preisach\""), &["preisach"]);
    rejected(&lab, &model.replace("\"stage\": \"pi\"", "\"stage\": \"magic\""), &["magic"]);
}

#[test]
fn a_missing_model_is_reported() {
    let lab = lab();
    let message = lab.fails("simulate --model absent.json train.csv -o out.csv", 2);
    assert!(message.contains("absent.json"), "{message}");
}
