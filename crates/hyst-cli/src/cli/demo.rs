//! Arguments of `demo`.

use std::path::PathBuf;

use clap::Args;

use super::shared::JsonArg;

/// Run all steps on a simulated actuator: experiment, fit, diagnosis, compensation
///
/// The seed chooses the effect that the actuator has besides hysteresis; fit and diagnosis use only the records. Writes
/// records, models, findings, the drive, a log of the compensated run and a picture.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  hystctl demo --seed 3 --out demo-out")]
pub(crate) struct DemoArgs {
    /// Seed that chooses the simulated actuator
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Folder to write into: new, empty, or of an earlier demo, whose files are replaced
    #[arg(long, value_name = "FOLDER", default_value = "demo-out")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}
