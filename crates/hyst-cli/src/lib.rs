//! What `hystctl` has that other programs use too: the log of a run, the page of a diagnosis.
//!
//! ```
//! use hyst_cli::log::{LoggedSample, RunInfo, RunLog};
//! use hyst_hw::{Phase, Sample};
//! use hyst_ident::record::OutputUnit;
//!
//! let folder = tempfile::tempdir()?;
//! let info = RunInfo { device: "bench", output: OutputUnit::Micrometre, sample_rate_hz: 1000.0, model: None };
//! let mut log = RunLog::create(&folder.path().join("run.mcap"), &info)?;
//! let sample = Sample { time_s: 0.001, drive_v: 1.0, output: 0.2, temperature_degc: None, load_n: None, force_n: None };
//! log.sample(&LoggedSample::new(0, Phase::Record, &sample, None))?;
//! log.finish()?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "program")]
pub mod log;
pub mod report;
pub mod text;
