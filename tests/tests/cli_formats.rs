//! Files that `convert` writes for other programs are records again, bit for bit; `info` and `plot` show them.

use hyst_ident::record::{ColumnMap, Need, Record};
use hyst_tests::Lab;

#[test]
fn what_convert_writes_is_read_again_bit_for_bit() {
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
    let message = lab.refuses("convert train.csv out.xyz", 2);
    assert!(message.contains(".npy") && message.contains(".tdms"), "{message}");
}

#[test]
fn info_names_channels_units_and_the_next_command() {
    let lab = Lab::with_train("");
    lab.ok("convert train.csv train.mat");
    let told = lab.ok("info train.mat").stdout;
    for part in ["MATLAB 5", "voltage_v", "µm", "samples a second", "hystctl fit train.mat --model pi -o model.json"] {
        assert!(told.contains(part), "\"{part}\" is missing in: {told}");
    }
    lab.write("asks.csv", "t,V,x\n0,1,2\n1,2,3\n2,3,4\n");
    let told = lab.ok("info asks.csv").stdout;
    assert!(told.contains("not a record yet") && told.contains("--map time_s=t"), "{told}");
}

#[test]
fn plot_draws_records_and_what_models_miss() {
    let lab = Lab::with_train("");
    lab.ok("fit train.csv --model pi -o pi.json");
    lab.ok("plot train.csv --model pi.json -o a.svg");
    let svg = lab.read("a.svg");
    for part in ["loops: output over input", "amplitude density", "measured minus predicted by pi", "train.csv, RMS"] {
        assert!(svg.contains(part), "{part}");
    }
    assert!(lab.refuses("plot train.csv -o a.png", 2).contains("SVG"));
}
