//! Files that `convert` writes for other programs are read again bit for bit; `info` and `plot` show them.

use hyst_ident::record::{ColumnMap, Need, Record};
use hyst_tests::Lab;

#[test]
fn converted_files_are_read_again_bit_for_bit() {
    let lab = Lab::with_train("");
    let record = |name: &str| Record::read(lab.path(name), &ColumnMap::default(), Need::InputAndOutput).unwrap();
    let own = record("train.csv");
    for ending in ["csv", "npy", "mat", "tdms"] {
        let name = format!("out.{ending}");
        lab.ok(&format!("convert train.csv {name}"));
        let read = record(&name);
        assert_eq!(read.input(), own.input(), "{ending}");
        assert_eq!(read.output(), own.output(), "{ending}");
        assert_eq!(read.segments(), own.segments(), "{ending}");
        assert_eq!(read.sample_period(), own.sample_period(), "{ending}");
    }
    let message = lab.fails("convert train.csv out.xyz", 2);
    assert!(message.contains(".npy") && message.contains(".tdms"), "{message}");
}

#[test]
fn info_names_channels_units_and_the_next_command() {
    let lab = Lab::with_train("");
    lab.ok("convert train.csv train.mat");
    let printed = lab.ok("info train.mat").stdout;
    for part in
        ["MATLAB 5", "voltage_v", "µm", "samples per second", "hystctl fit train.mat --model pi -o train-pi.json"]
    {
        assert!(printed.contains(part), "\"{part}\" is missing in: {printed}");
    }
    lab.write("asks.csv", "t,V,x,w\n0,1,2,5\n1,2,3,7\n2,3,4,1\n");
    let printed = lab.ok("info asks.csv").stdout;
    assert!(printed.contains("not a record yet") && printed.contains("--map time_s=t"), "{printed}");
    // A unit from the map is marked. A factor is the value of one number of the file.
    let printed = lab.ok("info asks.csv --map time_ms=t --map voltage_v=V --map displacement_um=2*x").stdout;
    let line = |name: &str| {
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let found = printed.lines().map(words).find(|words| words.first().is_some_and(|word| word == name));
        found.unwrap_or_else(|| panic!("no line of {name} in: {printed}"))
    };
    assert_eq!(line("t")[1..3], ["time", "ms*"], "{printed}");
    assert_eq!(line("V")[1..3], ["input", "V*"], "{printed}");
    assert_eq!(line("x")[1..4], ["output", "2", "µm*"], "{printed}");
    assert_eq!(line("w")[1..3], ["-", "?"], "{printed}");
    assert!(
        printed.contains("times from the column \"t\"") && printed.contains("from --map, not from the file"),
        "{printed}"
    );
    lab.write("rated.csv", "voltage_v,displacement_um\n1,2\n2,3\n3,4\n");
    assert!(lab.ok("info rated.csv --rate 10").stdout.contains("times from --rate"));
    // A counter is not an output, and a sensor in volts needs its scale.
    lab.write("scope.csv", "Sample Interval,0.001\nX,CH1,CH2\nSequence,Volt,Volt\n0,1,2\n1,2,3\n2,4,4\n3,5,4\n");
    let printed = lab.ok("info scope.csv").stdout;
    assert!(printed.contains("--map voltage_v=CH1 --map 'displacement_um=GAIN*CH2'"), "{printed}");
    assert!(printed.contains("Times come from the sample interval"), "{printed}");
    let printed = lab.ok("info scope.csv --map voltage_v=CH1 --map displacement_um=2*CH2").stdout;
    assert!(printed.contains("2 µm*") && printed.contains("marked * are from --map"), "{printed}");
    let rejected = lab.fails("fit scope.csv --map voltage_v=CH1 --map displacement_um=CH2 --model pi -o m.json", 2);
    assert!(rejected.contains("displacement_um=GAIN*CH2"), "{rejected}");
    // A map is shown although columns are missing, and a single column is reported as too few.
    lab.write("one.csv", "a\n1\n2\n4\n");
    let printed = lab.ok("info one.csv").stdout;
    assert!(printed.contains("the file has 1 column; a record also needs: time, input, output"), "{printed}");
    assert!(!printed.contains("COLUMN") && printed.contains("--map displacement_um=a --rate HZ"), "{printed}");
    let printed = lab.ok("info one.csv --map displacement_um=a").stdout;
    assert!(printed.contains("output") && printed.contains("µm*"), "{printed}");
    // No command is proposed for a record that `fit` rejects.
    lab.write("still.csv", "time_s,voltage_v,displacement_um\n0,1,2\n1,2,2\n2,3,2\n");
    let printed = lab.ok("info still.csv").stdout;
    assert!(printed.contains("is constant") && !printed.contains("next:"), "{printed}");
}

#[test]
fn plot_draws_records_and_residuals_of_models() {
    let lab = Lab::with_train("");
    lab.ok("fit train.csv --model pi -o pi.json");
    lab.ok("plot train.csv --model pi.json -o a.svg");
    let svg = lab.read("a.svg");
    for part in ["loops: output over input", "amplitude density", "measured minus predicted by pi", "train.csv, RMS"] {
        assert!(svg.contains(part), "{part}");
    }
    // A PNG has the same panels: check its header, and that it is not of a single colour.
    lab.ok("plot train.csv --model pi.json -o a.png");
    let png = std::fs::read(lab.path("a.png")).unwrap();
    assert!(png.starts_with(b"\x89PNG\r\n\x1a\n") && png.len() > 20_000, "{} bytes", png.len());
    assert!(lab.fails("plot train.csv -o a.pdf", 2).contains(".svg or .png"));
    lab.write("force.csv", "time_s,voltage_v,force_n\n0,1,2\n1,2,3\n2,3,5\n");
    assert!(lab.fails("plot train.csv force.csv -o b.svg", 2).contains("cannot share an axis"));
}

#[test]
fn a_dropout_is_reported_and_not_fitted() {
    let lab = Lab::with_train("");
    let text = lab.read("train.csv");
    let mut rows: Vec<String> = text.lines().map(str::to_owned).collect();
    for row in &mut rows[801..821] {
        let (kept, _) = row.rsplit_once(',').unwrap();
        *row = format!("{kept},0");
    }
    lab.write("dropout.csv", rows.join("\n"));
    let printed = lab.ok("info dropout.csv").stdout;
    assert!(printed.contains("repeats one value in 20 rows; the longest run starts in row 801"), "{printed}");
    let rmse = |file: &str| {
        lab.ok(&format!("fit {file} --model pi -o pi.json --json")).json()["errors"]["rmse"].as_f64().unwrap()
    };
    let (with, without) = (rmse("dropout.csv"), rmse("train.csv"));
    assert!((with / without - 1.0).abs() < 0.05, "{with} {without}");
}
