//! Damaged files of other programs. Each must give a record or an error, with memory in proportion to its size.

use hyst_ident::record::{Need, Reading, Record, Survey};

use super::random::Random;

/// Damages one of some valid files and reads it.
fn damaged(random: &mut Random, valid: &[&[u8]]) {
    let mut bytes = random.of(valid).to_vec();
    random.damage(&mut bytes);
    let need = *random.of(&[Need::InputAndOutput, Need::Input, Need::Output]);
    match Record::parse("a.bin", &bytes, Reading::default(), need) {
        Ok(record) => {
            assert!(record.time().iter().chain(record.input()).all(|value| value.is_finite()));
            assert!(record.sample_period() > 0.0);
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("a.bin") && message.len() < 4000, "{message}");
        }
    }
    let _ = Survey::parse("a.bin", &bytes, &Reading::default());
}

pub(super) fn tables(random: &mut Random) {
    const EUROPEAN: &[u8] = b"\"Zeit (s)\";\"Spannung [V]\";\"Weg \xb5m\"\r\n0,000;1,5;0,3\r\n0,001;2,5;;\r\n0,003;3,5;0,7\r\n0,004;4,5;0,9\r\n";
    const SCOPE: &[u8] =
        b"Model,X\nSample Interval,0.001,s\nTIME,CH1,CH2\n(s),(V),(um)\n\n0.0,1,2\n0.001,2,NaN\n0.002,3,4\n";
    const DATES: &[u8] =
        b"# made\ntime voltage_v displacement_um\n2024-05-31T12:00:00.000 1 2\n2024-05-31T12:00:00.001 2 3\n";
    damaged(random, &[EUROPEAN, SCOPE, DATES]);
}

pub(super) fn matlab(random: &mut Random) {
    const V4: &[u8] = include_bytes!("../../seeds/v4.mat");
    const V5: &[u8] = include_bytes!("../../seeds/v5.mat");
    const V7: &[u8] = include_bytes!("../../seeds/v7.mat");
    damaged(random, &[V4, V5, V7]);
}

pub(super) fn hdf5(random: &mut Random) {
    const PLAIN: &[u8] = include_bytes!("../../seeds/plain.h5");
    const LATEST: &[u8] = include_bytes!("../../seeds/latest.h5");
    const MATLAB: &[u8] = include_bytes!("../../seeds/matlab73.mat");
    damaged(random, &[PLAIN, LATEST, MATLAB]);
}

pub(super) fn labview(random: &mut Random) {
    const TDMS: &[u8] = include_bytes!("../../seeds/plain.tdms");
    const LVM: &[u8] = b"LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\nSamples\t3\t3\t\nY_Unit_Label\tV\tum\t\nX0\t0.0\t0.0\t\nDelta_X\t0.001\t0.001\t\n***End_of_Header***\t\t\t\nX_Value\tvoltage_v\tdisplacement_um\tComment\n0.000\t1.0\t2.0\t\n0.001\t2.0\t3.0\t\n0.002\t3.0\t4.0\t\n";
    damaged(random, &[TDMS, LVM]);
}

pub(super) fn numpy(random: &mut Random) {
    const FIELDS: &[u8] = include_bytes!("../../seeds/fields.npy");
    const ARCHIVE: &[u8] = include_bytes!("../../seeds/plain.npz");
    damaged(random, &[FIELDS, ARCHIVE]);
}

pub(super) fn parquet(random: &mut Random) {
    const SNAPPY: &[u8] = include_bytes!("../../seeds/snappy.parquet");
    const NULLS: &[u8] = include_bytes!("../../seeds/nulls.parquet");
    damaged(random, &[SNAPPY, NULLS]);
}

pub(super) fn arrow(random: &mut Random) {
    const FEATHER: &[u8] = include_bytes!("../../seeds/lz4.feather");
    const STREAM: &[u8] = include_bytes!("../../seeds/stream.arrow");
    damaged(random, &[FEATHER, STREAM]);
}

pub(super) fn excel(random: &mut Random) {
    const PLAIN: &[u8] = include_bytes!("../../seeds/plain.xlsx");
    damaged(random, &[PLAIN]);
}

pub(super) fn messages(random: &mut Random) {
    const JSON: &[u8] = include_bytes!("../../seeds/json.mcap");
    const ROS2: &[u8] = include_bytes!("../../seeds/ros2.mcap");
    const PROTOBUF: &[u8] = include_bytes!("../../seeds/protobuf.mcap");
    damaged(random, &[JSON, ROS2, PROTOBUF]);
}
