//! Practice and measured records that are not part of the project (`HYST_DATA`). Ignored if they are missing.

use std::path::Path;

use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::{ColumnMap, Need, Record};
use hyst_ident::simulate::{Zero, simulate};
use hyst_tests::data;

fn read(path: &Path) -> Record {
    Record::read(path, &ColumnMap::default(), Need::InputAndOutput).unwrap()
}

/// The start-up rows are found and excluded, and the extended model has a smaller error on the test record.
#[test]
#[cfg_attr(not(records), ignore = "no records: set HYST_DATA, see CONTRIBUTING.md")]
fn the_measured_micromanipulator_is_extended() {
    let folder = data().join("measured");
    let train = read(&folder.join("micromanipulator-train.csv"));
    let test = read(&folder.join("micromanipulator-test.csv"));
    let model = fit(&train, Kind::Pi, &FitOptions::default()).unwrap();
    let settling = model.fitted_on[0].settling_rows;
    assert!((5..400).contains(&settling), "{settling} start-up rows at 200 Hz");
    let options = DiagnoseOptions { zero: Zero::PerRecord, ..DiagnoseOptions::default() };
    let d = diagnose(&train, Some(&test), &model, &options, &|_| {}).unwrap();
    let (before, after) = (d.findings.before.test.unwrap(), d.findings.after.test.unwrap());
    println!(
        "test RMSE {:.4} → {:.4} µm ({:.2} → {:.2} % of span)",
        before.rmse, after.rmse, before.nrmse_percent, after.nrmse_percent
    );
    assert!(after.rmse < 0.8 * before.rmse);
    assert_eq!(simulate(&d.extended, &test, Zero::PerRecord).unwrap().errors, Some(after));
}

/// Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.
mod long {
    use super::*;

    /// Uses the base that the truth file states.
    #[test]
    #[cfg_attr(not(records), ignore = "no records: set HYST_DATA, see CONTRIBUTING.md")]
    fn effects_of_every_practice_actuator_are_named_exactly() {
        let folder = data().join("practice");
        let mut cases: Vec<_> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir()).collect();
        cases.sort();
        let mut wrong = Vec::new();
        for case in &cases {
            let truth: serde_json::Value =
                serde_json::from_str(&std::fs::read_to_string(case.join("truth.json")).unwrap()).unwrap();
            let kind: Kind = truth["model"].as_str().unwrap().parse().unwrap();
            let (train, test) = (read(&case.join("train.csv")), read(&case.join("test.csv")));
            let model = fit(&train, kind, &FitOptions::default()).unwrap();
            let d = diagnose(&train, Some(&test), &model, &DiagnoseOptions::default(), &|_| {}).unwrap();
            let mut named: Vec<&str> = d.findings.effects.iter().map(|e| e.name.name()).collect();
            let mut expected: Vec<&str> =
                truth["expect"].as_array().unwrap().iter().filter_map(|e| e.as_str()).collect();
            named.sort_unstable();
            expected.sort_unstable();
            let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
            println!("{}: named {named:?}, test RMSE {before:.4} → {after:.4} µm", case.display());
            if named != expected {
                wrong.push(format!("{}: named {named:?}, expected {expected:?}", case.display()));
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
}
