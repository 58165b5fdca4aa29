use super::*;
use proptest::prelude::*;

/// Builds the description of an object: path, index and properties.
struct Described(Vec<u8>);

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn object(path: &str, index: &[u8]) -> Described {
    Described([text(path), index.to_vec(), 0_u32.to_le_bytes().to_vec()].concat())
}

impl Described {
    /// Adds a property. `so_far` has the place of the count, which is before the properties, and the number of
    /// properties.
    fn with(mut self, so_far: &mut (usize, u32), name: &str, kind: u32, value: &[u8]) -> Self {
        if so_far.1 == 0 {
            so_far.0 = self.0.len() - 4;
        }
        so_far.1 += 1;
        self.0[so_far.0..so_far.0 + 4].copy_from_slice(&so_far.1.to_le_bytes());
        self.0.extend([text(name), kind.to_le_bytes().to_vec(), value.to_vec()].concat());
        self
    }
}

/// Returns the raw data index of `count` values of a type.
fn index(kind: u32, count: u64) -> Vec<u8> {
    [&20_u32.to_le_bytes()[..], &kind.to_le_bytes(), &1_u32.to_le_bytes(), &count.to_le_bytes()].concat()
}

const NO_DATA: [u8; 4] = [0xFF; 4];
const DESCRIBED: u32 = 2 | 4 | 8;

fn segment(flags: u32, objects: &[Described], raw: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    if flags & 2 != 0 {
        body.extend((objects.len() as u32).to_le_bytes());
        objects.iter().for_each(|object| body.extend(&object.0));
    }
    let described = body.len() as u64;
    body.extend(raw);
    let lead_in = [b"TDSm".to_vec(), flags.to_le_bytes().to_vec(), 4713_u32.to_le_bytes().to_vec()].concat();
    [lead_in, (body.len() as u64).to_le_bytes().to_vec(), described.to_le_bytes().to_vec(), body].concat()
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Two waveforms of three rows, in volts and micrometres.
fn waveforms() -> Vec<u8> {
    let channel = |name: &str, unit: &str| {
        let count = &mut (0, 0);
        object(&format!("/'Log'/'{name}'"), &index(10, 3))
            .with(count, "unit_string", 0x20, &text(unit))
            .with(count, "wf_increment", 10, &1e-3_f64.to_le_bytes())
            .with(count, "wf_start_offset", 10, &0.5_f64.to_le_bytes())
    };
    let objects = [object("/", &NO_DATA), object("/'Log'", &NO_DATA), channel("It''s U", "V"), channel("x", "µm")];
    segment(DESCRIBED, &objects, &doubles(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
}

fn error(bytes: &[u8]) -> String {
    read("x.tdms", bytes).unwrap_err().to_string()
}

#[test]
fn waveforms_are_columns_with_units_and_times() {
    let table = read("x.tdms", &waveforms()).unwrap();
    let names: Vec<&str> = table.heads.iter().map(|head| head.name.as_str()).collect();
    assert_eq!(names, ["Log/It's U", "Log/x"]);
    assert_eq!(table.heads[1].unit.as_deref(), Some("µm"));
    assert_eq!(table.heads[0].axis, Axis::Even { start: 0.5, step: 1e-3 });
    assert_eq!(table.values, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert!(is(&waveforms()) && !is(b"TDS"));
}

#[test]
fn a_segment_without_description_continues_the_one_before() {
    let more = segment(8, &[], &doubles(&[7.0, 8.0, 9.0, 10.0, 11.0, 12.0]));
    let table = read("x.tdms", &[waveforms(), more].concat()).unwrap();
    assert_eq!(table.values, [[1.0, 2.0, 3.0, 7.0, 8.0, 9.0], [4.0, 5.0, 6.0, 10.0, 11.0, 12.0]]);
    assert!(table.notes.is_empty(), "{:?}", table.notes);
}

#[test]
fn complete_rows_of_a_truncated_file_are_read() {
    let more = segment(8, &[], &doubles(&[7.0, 8.0, 9.0, 10.0, 11.0, 12.0]));
    let bytes = [waveforms(), more].concat();
    let table = read("x.tdms", &bytes[..bytes.len() - 9]).unwrap();
    assert_eq!(table.values, [[1.0, 2.0, 3.0, 7.0], [4.0, 5.0, 6.0, 10.0]]);
    assert!(table.notes[0].contains("cut off in its segment 2; the 4 rows"), "{:?}", table.notes);
    // The length that a program leaves if it is stopped while writing.
    let mut bytes = waveforms();
    bytes[12..20].copy_from_slice(&u64::MAX.to_le_bytes());
    assert_eq!(read("x.tdms", &bytes).unwrap().values.len(), 2);
}

#[test]
fn integers_of_either_byte_order_can_be_interleaved() {
    let objects =
        [object("/'g'/'a'", &index(2, 2)), object("/'g'/'b'", &index(9, 2)), object("/'g'/'c'", &index(0x21, 2))];
    let raw = [
        &(-2_i16).to_le_bytes()[..],
        &0.1_f32.to_le_bytes(),
        &[1],
        &300_i16.to_le_bytes(),
        &1e9_f32.to_le_bytes(),
        &[0],
    ];
    let table = read("x.tdms", &segment(DESCRIBED | 0x20, &objects, &raw.concat())).unwrap();
    assert_eq!(table.values, [vec![-2.0, 300.0], vec![f64::from(0.1_f32), 1e9], vec![1.0, 0.0]]);
    let big = |value: &[u8]| value.iter().rev().copied().collect::<Vec<u8>>();
    let path = "/'g'/'a'";
    let described = [
        big(&1_u32.to_le_bytes()),
        big(&(path.len() as u32).to_le_bytes()),
        path.as_bytes().to_vec(),
        big(&20_u32.to_le_bytes()),
        big(&3_u32.to_le_bytes()),
        big(&1_u32.to_le_bytes()),
        big(&2_u64.to_le_bytes()),
        vec![0; 4],
    ]
    .concat();
    let raw = [big(&(-70_000_i32).to_le_bytes()), big(&5_i32.to_le_bytes())].concat();
    let lead_in = [b"TDSm".to_vec(), (DESCRIBED | 0x40).to_le_bytes().to_vec(), vec![0; 4]].concat();
    let lengths =
        [big(&((described.len() + raw.len()) as u64).to_le_bytes()), big(&(described.len() as u64).to_le_bytes())]
            .concat();
    let table = read("x.tdms", &[lead_in, lengths, described, raw].concat()).unwrap();
    assert_eq!(table.values, [[-70_000.0, 5.0]]);
}

#[test]
fn time_stamps_are_seconds_since_midnight() {
    let day = 41_000_i64 * 86_400;
    let stamp = |seconds: i64, fraction: u64| {
        [fraction.to_le_bytes().to_vec(), (day + seconds).to_le_bytes().to_vec()].concat()
    };
    let objects = [object("/'g'/'clock'", &index(0x44, 2)), object("/'g'/'x'", &index(10, 2))];
    let raw = [stamp(3600, 1 << 63), stamp(3601, 1 << 62), doubles(&[1.0, 2.0])].concat();
    let table = read("x.tdms", &segment(DESCRIBED, &objects, &raw)).unwrap();
    assert_eq!(table.values[0], [3600.5, 3601.25]);
    assert_eq!(table.heads[0].unit.as_deref(), Some("s"));
    assert_eq!(table.heads[1].axis, Axis::Column(0));
}

#[test]
fn scales_are_applied() {
    let count = &mut (0, 0);
    let scaled = object("/'g'/'a'", &index(2, 2))
        .with(count, "NI_Number_Of_Scales", 7, &2_u32.to_le_bytes())
        .with(count, "NI_Scale[0]_Scale_Type", 0x20, &text("Linear"))
        .with(count, "NI_Scale[0]_Linear_Slope", 10, &0.5_f64.to_le_bytes())
        .with(count, "NI_Scale[0]_Linear_Y_Intercept", 10, &1.0_f64.to_le_bytes())
        .with(count, "NI_Scale[0]_Linear_Input_Source", 7, &u32::MAX.to_le_bytes())
        .with(count, "NI_Scale[1]_Scale_Type", 0x20, &text("Polynomial"))
        .with(count, "NI_Scale[1]_Polynomial_Coefficients_Size", 7, &3_u32.to_le_bytes())
        .with(count, "NI_Scale[1]_Polynomial_Coefficients[0]", 10, &1.0_f64.to_le_bytes())
        .with(count, "NI_Scale[1]_Polynomial_Coefficients[1]", 10, &0.0_f64.to_le_bytes())
        .with(count, "NI_Scale[1]_Polynomial_Coefficients[2]", 10, &2.0_f64.to_le_bytes())
        .with(count, "NI_Scale[1]_Polynomial_Input_Source", 7, &0_u32.to_le_bytes());
    let raw = [2_i16, 4].iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let table = read("x.tdms", &segment(DESCRIBED, &[scaled], &raw)).unwrap();
    assert_eq!(table.values, [[9.0, 19.0]]);
    let other = object("/'g'/'a'", &index(2, 2)).with(&mut (0, 0), "NI_Scale[0]_Scale_Type", 0x20, &text("RTD"));
    let message = error(&segment(DESCRIBED, &[other], &raw));
    assert!(message.contains("\"g/a\" is not read: its scale \"RTD\" is not supported"), "{message}");
}

#[test]
fn scales_that_refer_in_a_circle_are_refused() {
    let mut described = object("/'g'/'a'", &index(2, 2));
    let count = &mut (0, 0);
    described = described.with(count, "NI_Number_Of_Scales", 7, &1_u32.to_le_bytes());
    described = described.with(count, "NI_Scale[0]_Scale_Type", 0x20, &text("Add"));
    described = described.with(count, "NI_Scale[0]_Add_Left_Operand_Input_Source", 7, &0_u32.to_le_bytes());
    described = described.with(count, "NI_Scale[0]_Add_Right_Operand_Input_Source", 7, &0_u32.to_le_bytes());
    assert!(error(&segment(DESCRIBED, &[described], &[0; 4])).contains("circle"));
}

#[test]
fn scalers_of_daqmx_and_digital_lines_are_read() {
    let scaler = |kind: u32, offset: u32, id: u32| [kind, 0, offset, 0, id].map(u32::to_le_bytes).concat();
    let daqmx = |scalers: &[Vec<u8>]| {
        let head = [0x1269_u32, u32::MAX, 1].map(u32::to_le_bytes).concat();
        let tail = [1_u32, 4].map(u32::to_le_bytes).concat();
        [head, 2_u64.to_le_bytes().to_vec(), (scalers.len() as u32).to_le_bytes().to_vec(), scalers.concat(), tail]
            .concat()
    };
    let objects = [object("/'g'/'a'", &daqmx(&[scaler(3, 0, 0)])), object("/'g'/'b'", &daqmx(&[scaler(2, 2, 0)]))];
    let table = read("x.tdms", &segment(DESCRIBED | 0x80, &objects, &[0xFF, 0xFF, 1, 0, 2, 0, 0, 1])).unwrap();
    assert_eq!(table.values, [[-1.0, 2.0], [1.0, 256.0]]);
    let twice = [object("/'g'/'a'", &daqmx(&[scaler(3, 0, 0), scaler(3, 2, 0)]))];
    assert!(error(&segment(DESCRIBED | 0x80, &twice, &[0; 8])).contains("scalers contradict"));
}

#[test]
fn runs_in_one_file_are_segments() {
    let start = |seconds: i64| [0_u64.to_le_bytes(), seconds.to_le_bytes()].concat();
    let run =
        |seconds: i64| {
            let count = &mut (0, 0);
            let channel = object("/'g'/'a'", &index(10, 2))
                .with(count, "wf_increment", 10, &0.1_f64.to_le_bytes())
                .with(count, "wf_start_time", 0x44, &start(seconds));
            segment(DESCRIBED, &[channel], &doubles(&[1.0, 2.0]))
        };
    let table = read("x.tdms", &[run(100), run(100), run(200)].concat()).unwrap();
    assert_eq!(table.heads[1].name, "segment");
    assert_eq!(table.values[1], [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
    assert!(table.notes[0].contains("restarts at row 5"), "{:?}", table.notes);
}

#[test]
fn impossible_sizes_are_refused() {
    let huge = segment(DESCRIBED, &[object("/'g'/'a'", &index(10, 1 << 61))], &[0; 24]);
    assert!(error(&huge).contains("\"g/a\": 2305843009213693952 values are impossible"), "{}", error(&huge));
    let huge = segment(DESCRIBED, &[object("/'g'/'a'", &index(10, 1 << 40))], &[0; 25]);
    assert!(error(&huge).contains("not a whole number of rows"), "{}", error(&huge));
    let mut many = waveforms();
    many[28..32].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(error(&many).contains("segment 1"), "{}", error(&many));
    assert!(error(b"TDSh").contains(".tdms"));
    assert!(error(&[waveforms(), b"rest".repeat(9)].concat()).contains("no segment begins at byte"));
}

#[test]
fn truncated_files_do_not_panic() {
    let bytes = [waveforms(), segment(8, &[], &doubles(&[0.0; 6]))].concat();
    for length in 0..bytes.len() {
        let _ = read("x.tdms", &bytes[..length]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]
    #[test]
    fn damaged_bytes_do_not_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = [waveforms(), segment(8, &[], &doubles(&[0.0; 6]))].concat();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let _ = read("x.tdms", &bytes);
    }
}
