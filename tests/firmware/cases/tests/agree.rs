//! The core computes the same bits on a Cortex-M4F as on the host, within a bounded stack.
//!
//! `cargo xtask firmware` runs `tests/firmware/agree` in QEMU, and then this test. `HYST_FIRMWARE` is the path of the
//! firmware's output.

use hyst_cases::{Case, Fingerprint, Precision, Visit, each, run};
use std::collections::BTreeMap;
use std::{env, fs};

/// Maximum stack of one step, call included (bytes).
const STEP_STACK: usize = 2048;

/// Maximum stack of building coefficients and resetting (bytes).
///
/// It holds several copies of the largest coefficients, because a `Result` is returned by value.
const BUILD_STACK: usize = 32 * 1024;

/// Maximum difference between runs in `f32` and `f64`, as a share of the span of the outputs.
const PRECISION_TOLERANCE: f64 = 1e-4;

/// All outputs of all cases, computed on the host.
#[derive(Default)]
struct Host(Vec<(&'static str, &'static str, Vec<u64>, Vec<f64>)>);

impl Visit for Host {
    fn visit<C: Case, T: Precision>(&mut self) {
        let y = run::<C, T>().unwrap_or_else(|error| panic!("{}: {error}", C::NAME));
        self.0.push((C::NAME, T::NAME, y.iter().map(|y| y.bits()).collect(), y.iter().map(|y| y.to_f64()).collect()));
    }
}

/// Output of the firmware: figures and bits of the outputs for each case and precision.
#[derive(Default)]
struct Firmware {
    figures: BTreeMap<(String, String), BTreeMap<String, String>>,
    bits: BTreeMap<(String, String), Vec<u64>>,
}

impl Firmware {
    /// Reads the output.
    fn read() -> Self {
        let path = env::var_os("HYST_FIRMWARE").expect("HYST_FIRMWARE is the output of the firmware");
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(text.lines().last(), Some("done"), "the firmware did not finish");
        let mut firmware = Self::default();
        for line in text.lines() {
            let mut words = line.split(' ');
            let kind = words.next();
            let key = (words.next().unwrap_or_default().to_owned(), words.next().unwrap_or_default().to_owned());
            match kind {
                Some("case") => {
                    let pairs = words.filter_map(|word| word.split_once('='));
                    firmware.figures.insert(key, pairs.map(|(k, v)| (k.to_owned(), v.to_owned())).collect());
                }
                Some("bits") => {
                    let bits = words.map(|word| u64::from_str_radix(word, 16).expect("hexadecimal digits"));
                    firmware.bits.insert(key, bits.collect());
                }
                _ => {}
            }
        }
        firmware
    }
}

/// Returns the number with these bits.
fn value(precision: &str, bits: u64) -> f64 {
    if precision == "f32" { f32::from_bits(bits as u32).into() } else { f64::from_bits(bits) }
}

#[test]
fn outputs_vary_and_single_precision_agrees_with_double_precision() {
    let mut host = Host::default();
    each(&mut host);
    assert!(host.0.len() >= 2);
    for pair in host.0.chunks(2) {
        let [(name, "f32", _, single), (_, "f64", _, double)] = pair else { panic!("cases come as f32 and f64") };
        let (low, high) = double.iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        assert!(single.iter().chain(double).all(|y| y.is_finite()) && high > low, "{name}: {low} to {high}");
        let worst = single.iter().zip(double).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(
            worst <= PRECISION_TOLERANCE * (high - low),
            "{name}: f32 differs from f64 by {worst}; the outputs are {low} to {high}"
        );
    }
}

#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn firmware_and_host_agree_bit_for_bit() {
    let firmware = Firmware::read();
    let mut host = Host::default();
    each(&mut host);
    let mut differ = Vec::new();
    for (name, precision, ours, _) in &host.0 {
        let key = ((*name).to_owned(), (*precision).to_owned());
        let Some(theirs) = firmware.bits.get(&key) else {
            differ.push(format!("{name} {precision} was not run"));
            continue;
        };
        assert_eq!(ours.len(), theirs.len(), "{name} {precision}: samples");
        let pairs = || ours.iter().zip(theirs).enumerate().filter(|(_, (a, b))| a != b);
        if let Some((k, (a, b))) = pairs().next() {
            let (count, is, was) = (pairs().count(), value(precision, *a), value(precision, *b));
            differ.push(format!(
                "{name} {precision}: {count} samples differ, first {k}: {a:x} ({is:e}) on the host, {b:x} ({was:e}) in firmware"
            ));
        }
        // The firmware's own fingerprint detects bits that were lost in the transfer.
        let hash = match *precision {
            "f32" => Fingerprint::of(&theirs.iter().map(|b| f32::from_bits(*b as u32)).collect::<Vec<_>>()),
            _ => Fingerprint::of(&theirs.iter().map(|b| f64::from_bits(*b)).collect::<Vec<_>>()),
        };
        assert_eq!(
            firmware.figures[&key]["hash"],
            format!("{:016x}", hash.0),
            "{name} {precision}: bits were lost in the transfer"
        );
    }
    assert!(differ.is_empty(), "host and firmware differ:\n{}", differ.join("\n"));
    assert_eq!(firmware.bits.len(), host.0.len(), "the firmware was built from another list of cases");
    println!("{} runs of 1000 samples agree in every bit", host.0.len());
}

#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn the_stack_is_bounded() {
    let firmware = Firmware::read();
    for ((name, precision), figures) in &firmware.figures {
        let figure = |key: &str| figures[key].parse::<usize>().expect("a number");
        assert!(figure("stack") <= STEP_STACK, "{name} {precision}: a step uses {} bytes of stack", figure("stack"));
        let build = figure("build_stack");
        assert!(build <= BUILD_STACK, "{name} {precision}: building uses {build} bytes of stack");
    }
}
