//! The bytes of parameter blocks that boards in the field have: one block of each operator and of each stage, in
//! `block_format.txt`, one line `name: hexadecimal bytes` each.
//!
//! A block has no names: a board misreads it if a parameter is moved, resized or reordered. If these tests fail, either
//! undo that, or increment [`BLOCK_VERSION`] and rewrite the file:
//!
//! ```text
//! HYST_WRITE_BLOCKS=1 cargo test -p hyst-tests block_format
//! ```
//!
//! With the same version, this writes only new lines: a new operator at the end, or a new value of an enumeration.

use std::fmt::Write as _;
use std::path::PathBuf;

use hyst_core::{
    ActivationParams, AsymmetryParams, BLOCK_VERSION, BlockError, BoucWenOscillatorParams, BoucWenParams, ChainParams,
    CreepParams, Curve, DelayParams, DpmParams, DriftParams, EffectParams, GlOrder, GpiParams, IfmParams,
    InterferenceParams, Kind, LagParams, LfdmParams, List, LoadParams, MaxwellSlipParams, MirrorParams, OperatorParams,
    PiParams, PreisachParams, RateLaw, RateParams, ResonanceParams, SaturationParams, SlipReading, TdEmParams,
    TdPiParams, TemperatureParams, ViscousPiParams, WideningParams, read_block, write_block,
};
use hyst_tests::root;

type Operator = OperatorParams<Vec<f64>>;
type Effects = EffectParams<Vec<f64>>;
type Block = ChainParams<Vec<f64>>;

/// Returns the operators. Every field has a different number, so that an exchange of two fields is detected.
fn operators() -> Vec<(&'static str, Operator)> {
    use OperatorParams as O;
    let pi = || PiParams { gain: 1.5, thresholds: vec![2.5, 3.5], weights: vec![4.5, 5.5] };
    let linear = Curve::Linear { slope: 1.5, offset: 2.5 };
    let tanh = Curve::Tanh { height: 3.5, rate: 4.5, shift: 5.5, offset: 6.5 };
    let gpi = |left, right| GpiParams { left, right, gain: 7.5, thresholds: vec![8.5], weights: vec![9.5] };
    let slip = |reading| MaxwellSlipParams { reading, widths: vec![1.5, 2.5], gains: vec![3.5, 4.5] };
    let preisach = || PreisachParams {
        low: 1.5,
        high: 2.5,
        cells: 2,
        rest: 3.5,
        density: vec![4.5, 5.5, 6.5],
        once: vec![7.5, 8.5],
    };
    let mirror = MirrorParams {
        rate_low: 9.5,
        rate_high: 10.5,
        rates: 1,
        change_low: 11.5,
        change_high: 12.5,
        changes: 2,
        weights: vec![13.5, 14.5],
    };
    let lfdm = |order| LfdmParams { a: 1.5, b: 2.5, c: 3.5, alpha: 4.5, beta: 5.5, order };
    let function = ActivationParams { k0: 1.5, alpha: 2.5, beta: 3.5, gamma: 4.5 };
    let td_pi = TdPiParams {
        alpha: 1.5,
        epsilon: 2.5,
        tau: 3.5,
        eta: 4.5,
        a0: 5.5,
        a1: 6.5,
        b0: 7.5,
        b1: 8.5,
        plays: 300,
        reference_degc: 9.5,
    };
    let td_em = TdEmParams {
        slip: slip(SlipReading::Backlash),
        capacitance: 5.5,
        resistance: 6.5,
        mass: 7.5,
        stiffness: 8.5,
        damping: 9.5,
        coupling: [10.5, 11.5, 12.5],
        per_metre: 13.5,
    };
    let ifm = IfmParams { a: 1.5, b: 2.5, c: 3.5, alpha: 4.5, beta: 5.5, tau: 6.5, delta: 7.5, order: GlOrder::Second };
    let oscillator = BoucWenOscillatorParams {
        mass: 1.5,
        damping: 2.5,
        stiffness: 3.5,
        alpha: 4.5,
        beta: 5.5,
        gamma: 6.5,
        delta: 7.5,
        nu: 8.5,
    };
    vec![
        ("pi", O::Pi(pi())),
        ("viscous-pi", O::ViscousPi(ViscousPiParams { pi: pi(), seconds: 6.5, volt_seconds: 7.5 })),
        ("gpi", O::Gpi(gpi(linear, tanh))),
        ("gpi, exchanged", O::Gpi(gpi(tanh, linear))),
        ("td-pi", O::TdPi(td_pi)),
        ("maxwell-slip", O::MaxwellSlip(slip(SlipReading::Backlash))),
        ("maxwell-slip, elasto-slip", O::MaxwellSlip(slip(SlipReading::ElastoSlip))),
        ("td-em", O::TdEm(td_em)),
        ("preisach", O::Preisach(preisach())),
        ("lfdm", O::Lfdm(lfdm(GlOrder::First))),
        ("lfdm, second order", O::Lfdm(lfdm(GlOrder::Second))),
        ("ifm", O::Ifm(ifm)),
        ("dpm", O::Dpm(DpmParams { preisach: preisach(), mirror, fade: 15.5 })),
        ("bouc-wen", O::BoucWen(BoucWenParams { k0: 1.5, alpha: 2.5, beta: 3.5, gamma: 4.5, n: 5.5 })),
        ("bouc-wen-oscillator", O::BoucWenOscillator(oscillator)),
        ("atan", O::Atan(function)),
        ("sigmoid", O::Sigmoid(function)),
        ("softplus", O::Softplus(function)),
        ("softsign", O::Softsign(function)),
        ("tanh", O::Tanh(function)),
    ]
}

/// Returns the effects of one chain for each stage, and of one with all stages.
fn effects() -> Vec<(&'static str, Effects)> {
    let none = Effects::default;
    let mode = |hz| ResonanceParams { hz, damping: 2.5, gain: 3.5 };
    let all = Effects {
        delay: Some(DelayParams { seconds: 1.5 }),
        lag: Some(LagParams { seconds: 2.5 }),
        rate: Some(RateParams { volts: 1.5, exponent: 2.5, reference_rate: 3.5, law: RateLaw::Holds }),
        widening: Some(WideningParams {
            growth: 1.5,
            exponent: 2.5,
            reference_rate: 3.5,
            seconds: 4.5,
            thresholds: vec![5.5],
            weights: vec![6.5],
        }),
        asymmetry: Some(AsymmetryParams::before(vec![1.5, 2.5], vec![3.5, 4.5])),
        temperature: Some(TemperatureParams {
            per_kelvin: 1.5,
            reference_degc: 2.5,
            expansion: 3.25,
            direct: 3.5,
            seconds: 4.25,
        }),
        creep: Some(CreepParams { seconds: vec![1.5, 2.5], shares: vec![3.5, 4.5] }),
        load: Some(LoadParams { per_newton: 1.5, gain_per_newton: 1.75 }),
        resonances: [Some(mode(1.5)), Some(mode(4.5))],
        saturation: Some(SaturationParams::behind(1.5, 2.5, 3.5)),
        drift: Some(DriftParams { per_second: 1.5, settling: 2.5, seconds: 3.5, since_s: 4.5 }),
        interference: Some(InterferenceParams {
            hz: 1.5,
            amplitude: 2.5,
            phase: 3.5,
            harmonics: [4.5, 5.5, 6.5, 7.5, 8.5, 9.5, 10.5, 11.5],
        }),
    };
    // Destructured by name: a new stage must be added here.
    let Effects {
        delay,
        lag,
        rate,
        widening,
        asymmetry,
        temperature,
        creep,
        load,
        resonances,
        saturation,
        drift,
        interference,
    } = all.clone();
    vec![
        ("delay", Effects { delay, ..none() }),
        ("lag", Effects { lag, ..none() }),
        ("widening", Effects { widening, ..none() }),
        ("rate", Effects { rate, ..none() }),
        ("asymmetry", Effects { asymmetry, ..none() }),
        ("temperature", Effects { temperature, ..none() }),
        ("creep", Effects { creep, ..none() }),
        ("load", Effects { load, ..none() }),
        ("resonance", Effects { resonances: [resonances[0], None], ..none() }),
        ("two resonances", Effects { resonances, ..none() }),
        ("saturation", Effects { saturation, ..none() }),
        ("saturation of the drive", Effects { saturation: Some(SaturationParams::before(1.5, 2.5, 3.5)), ..none() }),
        ("drift", Effects { drift, ..none() }),
        ("interference", Effects { interference, ..none() }),
        ("every stage", all),
    ]
}

fn blocks() -> Vec<(String, Block)> {
    let (zero, input) = (-0.25, [-10.5, 120.5]);
    let block = |operator, effects| Block { operator, effects, falls: false, zero, input };
    let smallest = || Operator::Pi(PiParams { gain: 1.5, thresholds: Vec::new(), weights: Vec::new() });
    let of_operators = operators().into_iter().map(|(name, o)| (name.to_owned(), block(o, Effects::default())));
    let of_effects = effects().into_iter().map(|(name, e)| (format!("{name} (stage)"), block(smallest(), e)));
    let falling = Block { falls: true, ..block(smallest(), Effects::default()) };
    of_operators.chain(of_effects).chain([("falling".to_owned(), falling)]).collect()
}

fn bytes(block: &Block) -> Vec<u8> {
    let mut buffer = [0; 1024];
    write_block(block, &mut buffer).expect("small parameters").to_vec()
}

fn file() -> PathBuf {
    root().join("tests/tests/block_format.txt")
}

fn unhex(digits: &str) -> Vec<u8> {
    let hex = |digits: &str| u8::from_str_radix(digits, 16).expect("two hexadecimal digits");
    (0..digits.len() / 2).map(|k| hex(&digits[2 * k..2 * k + 2])).collect()
}

/// Returns the lines of the file; none if it does not exist.
fn stored() -> Vec<(String, Vec<u8>)> {
    let text = std::fs::read_to_string(file()).unwrap_or_default();
    let line = |line: &str| {
        let (name, digits) = line.split_once(": ").expect("name: bytes");
        (name.to_owned(), unhex(digits))
    };
    text.lines().map(line).collect()
}

/// Writes the file. Lines of `old` with the present version are kept.
fn rewrite(old: &[(String, Vec<u8>)]) {
    let mut text = String::new();
    for (name, block) in blocks() {
        let new = bytes(&block);
        let kept = old.iter().find(|(other, bytes)| *other == name && bytes.get(4) == Some(&BLOCK_VERSION));
        let shown: String = kept.map_or(&new, |(_, bytes)| bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        let _ = writeln!(text, "{name}: {shown}");
    }
    std::fs::write(file(), text).expect("the file can be written");
}

#[test]
fn blocks_have_the_stored_bytes() {
    if std::env::var_os("HYST_WRITE_BLOCKS").is_some() {
        rewrite(&stored());
    }
    let stored = stored();
    let names: Vec<&str> = stored.iter().map(|(name, _)| name.as_str()).collect();
    let blocks = blocks();
    assert_eq!(names, blocks.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), "see the head of this file");
    for ((name, old), (_, block)) in stored.iter().zip(&blocks) {
        assert_eq!(*old, bytes(block), "{name}: the format has changed; see the head of this file");
        // A board without heap reads them too.
        let board = read_block::<List<8>, List<2>>(old).unwrap_or_else(|e| panic!("{name}: {e}"));
        let again = read_block::<Vec<f64>, Vec<f64>>(old).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((again, board.operator.kind()), (block.clone(), block.operator.kind()), "{name}");
    }
}

/// A block of version 1, without `volt_seconds`: its numbers would be misread.
#[test]
fn a_block_of_an_older_version_is_rejected() {
    const OLD: &str = "\
        48595354015600000001000000000000f83f0200000000000004400000000000000c40020000000000001240000000000000\
        16400000000000001a400000000000000000000000000000000000d0bf00000000000025c00000000000205e40ca03433d";
    let error = read_block::<Vec<f64>, Vec<f64>>(&unhex(OLD)).unwrap_err();
    assert_eq!(error, BlockError::Version { version: 1 });
    assert!(error.to_string().contains("block version 1, this build reads 8: export the model again"), "{error}");
}

/// The layout is that documented at `hyst_core::read_block`.
#[test]
fn a_block_is_head_payload_and_check_sum() {
    for (name, old) in stored() {
        assert_eq!((&old[..4], old[4]), (&b"HYST"[..], BLOCK_VERSION), "{name}");
        let length = u32::from_le_bytes(old[5..9].try_into().unwrap());
        assert_eq!(old.len(), 9 + length as usize + 4, "{name}");
    }
}

/// The first byte of a payload is the number of the operator. Every number up to the last and every kind must be
/// stored.
#[test]
fn every_operator_is_stored() {
    let mut numbers: Vec<u8> = operators()
        .iter()
        .map(|(name, _)| {
            let (_, old) = stored().into_iter().find(|(other, _)| other == name).expect("a stored block");
            old[9]
        })
        .collect();
    numbers.dedup();
    let count = u8::try_from(numbers.len()).unwrap();
    assert_eq!(numbers, (0..count).collect::<Vec<_>>());
    let kinds: Vec<Kind> = operators().iter().map(|(_, operator)| operator.kind()).collect();
    assert!(Kind::ALL.iter().all(|kind| kinds.contains(kind)));
}
