//! Arguments of `compare`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use hyst_ident::fit::FitOptions;
use hyst_ident::model::Kind;

use super::help::{COMPARE, RECORDS};
use super::shared::{JsonArg, MapArg, ZeroArg};
use crate::output::Target;

/// Fit all kinds of models to a record and compare their errors
///
/// Models are fitted to the training records only; the test record is only simulated. All models are compared on the
/// same rows: a start-up row of one model is left out for all. A model that cannot be fitted to the records is listed
/// with the reason.
#[derive(Debug, Args)]
#[command(after_help = format!("{COMPARE}\n\n{RECORDS}"))]
pub(crate) struct CompareArgs {
    /// Records to fit; several records are fitted together
    #[arg(required = true)]
    pub(crate) train: Vec<PathBuf>,
    /// Test record, never fitted; models are sorted by their error on it, or on the training records if not given
    #[arg(long)]
    pub(crate) test: Option<PathBuf>,
    /// Kinds of models, separated by commas; all kinds if not given
    #[arg(long, value_name = "all|KIND,KIND…", default_value = "all")]
    pub(crate) models: Kinds,
    /// Seed of random draws
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Number of searches with different random draws; the best one is taken
    #[arg(long, default_value_t = 1)]
    pub(crate) trials: usize,
    /// Maximum number of evaluations of a trial; if not given 1500 for each searched variable, or 200 for each with
    /// bouc-wen-oscillator
    #[arg(long, value_name = "COUNT")]
    pub(crate) evaluations: Option<u64>,
    /// Picture to write, .svg or .png: errors and residuals of all models
    #[arg(long, value_name = "PICTURE")]
    pub(crate) picture: Option<Target>,
    #[command(flatten)]
    pub(crate) zero: ZeroArg,
    #[command(flatten)]
    pub(crate) map: MapArg,
    #[command(flatten)]
    pub(crate) json: JsonArg,
}

impl CompareArgs {
    /// Returns the options of each fit.
    pub(crate) fn options(&self, zero_per_record: bool) -> FitOptions {
        FitOptions {
            seed: self.seed,
            zero_per_record,
            trials: self.trials,
            evaluations: self.evaluations,
            ..FitOptions::default()
        }
    }
}

/// Kinds of models, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Kinds(pub(crate) Vec<Kind>);

impl FromStr for Kinds {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self(Kind::ALL.to_vec()));
        }
        let mut kinds = Vec::new();
        for name in text.split(',') {
            let known = name.trim().parse::<Kind>().ok();
            let all = || Kind::ALL.map(Kind::name).join(", ");
            let kind =
                known.ok_or_else(|| format!("{:?} is not a kind of model; give all, or some of {}", name, all()))?;
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        Ok(Self(kinds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_a_list_without_repetition() {
        assert_eq!("pi, tanh,pi".parse(), Ok(Kinds(vec![Kind::Pi, Kind::Tanh])));
        assert_eq!("all".parse(), Ok(Kinds(Kind::ALL.to_vec())));
        for text in ["", "pi,,tanh", "pi;tanh", "pii", "all,pi"] {
            assert!(text.parse::<Kinds>().unwrap_err().contains("bouc-wen"), "{text}");
        }
    }
}
