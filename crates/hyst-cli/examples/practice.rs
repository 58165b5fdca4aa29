//! dev only
use hyst_ident::{diagnose::*, fit::*, model::*, record::*};
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let dir = &args[1];
    let kind: Kind = args[2].parse().unwrap();
    let verbose = args.len() > 3;
    let map = ColumnMap::default();
    let train = Record::read(format!("{dir}train.csv"), &map, Need::InputAndOutput).unwrap();
    let test = Record::read(format!("{dir}test.csv"), &map, Need::InputAndOutput).unwrap();
    let t = Instant::now();
    let m = fit(&train, kind, &FitOptions::default()).unwrap();
    let tf = t.elapsed();
    let d = diagnose(&train, Some(&test), &m, &DiagnoseOptions::default(), &|_| {}).unwrap();
    let f = &d.findings;
    let names: Vec<_> = f.effects.iter().map(|e| e.name.name()).collect();
    println!(
        "{dir} {kind} fit {:.2}s diag {:.2}s names {names:?} verdict {:?} noise {:.4} train {:.4}->{:.4} test {:.4}->{:.4} settling {} rem {}",
        tf.as_secs_f64(),
        t.elapsed().as_secs_f64() - tf.as_secs_f64(),
        f.verdict,
        f.noise_floor,
        f.before.train.unwrap().rmse,
        f.after.train.unwrap().rmse,
        f.before.test.unwrap().rmse,
        f.after.test.unwrap().rmse,
        m.fitted_on[0].settling_rows,
        f.remainder.description
    );
    if verbose {
        println!("{}", serde_json::to_string_pretty(&f).unwrap());
    }
    let back = Model::parse("x", &d.extended.to_json()).unwrap();
    assert_eq!(back, d.extended);
}
