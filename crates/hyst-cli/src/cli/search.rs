//! Arguments of the parameter search of a fit.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hyst_ident::BetweenSamples;
use hyst_ident::fit::{FitOptions, Optimizer, VariableBounds};
use hyst_ident::identify::Form;

use crate::exit::CommandError;

/// Options of the parameter search of a fit.
#[derive(Debug, Args)]
pub(crate) struct SearchArgs {
    /// Optimizer; auto chooses one and prints which and why
    #[arg(long, value_name = "WAY", default_value = "auto", value_parser = optimizers())]
    pub(crate) optimizer: Optimizer,
    /// Seed of random draws, written to the model; 1 if not given, but an optimizer that you choose needs one
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// Number of searches with different random draws; the best one is taken
    #[arg(long, default_value_t = 1)]
    pub(crate) trials: usize,
    /// Maximum number of evaluations of a trial; if not given 1500 for each searched variable, or 200 for each with
    /// bouc-wen-oscillator
    #[arg(long, value_name = "COUNT")]
    pub(crate) evaluations: Option<u64>,
    /// Population size (members, particles or wolves); the default of the optimizer if not given
    #[arg(long, value_name = "COUNT")]
    pub(crate) population: Option<usize>,
    /// Bounds of a searched variable, instead of those derived from the record; can be repeated
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = bounds, allow_hyphen_values = true)]
    pub(crate) bounds: Vec<VariableBounds>,
    /// Form of bouc-wen (zhu: n = 1; xie: n is searched) or of an element of maxwell-slip (backlash, elasto-slip)
    #[arg(long, value_parser = forms())]
    pub(crate) form: Option<Form>,
    /// Interpolation of the drive of bouc-wen-oscillator between samples: linear or band-limited; if not given, both
    /// are tried and the one with the smaller residual is written to the model
    #[arg(long, value_parser = between_samples())]
    pub(crate) between_samples: Option<BetweenSamples>,
    /// Number of play operators (gpi, td-pi, and pi with a search) or of elements (td-em); maximum number of elements
    /// of maxwell-slip
    #[arg(long, value_name = "COUNT")]
    pub(crate) elements: Option<usize>,
    /// Maximum number of thresholds of pi, placed where the record needs them. If not given, the thresholds are evenly
    /// spaced; placed ones replace them only if they predict parts of the record clearly better
    #[arg(long, value_name = "COUNT")]
    pub(crate) thresholds: Option<usize>,
}

impl SearchArgs {
    /// Returns the options of a fit.
    pub(crate) fn options(&self, zero_per_record: bool) -> Result<FitOptions, CommandError> {
        let seed = match (&self.optimizer, self.seed) {
            (_, Some(seed)) => seed,
            (Optimizer::Search(name), None) => {
                return Err(CommandError::bad_input(format!(
                    "--optimizer {name} is random and needs a seed to be repeatable; give --seed N, for example --seed 1"
                )));
            }
            (_, None) => 1,
        };
        Ok(FitOptions {
            seed,
            zero_per_record,
            optimizer: self.optimizer.clone(),
            trials: self.trials,
            evaluations: self.evaluations,
            population: self.population,
            bounds: self.bounds.clone(),
            form: Form {
                elements: self.elements,
                between_samples: self.between_samples,
                ..self.form.unwrap_or_default()
            },
            thresholds: self.thresholds,
        })
    }
}

fn optimizers() -> impl TypedValueParser<Value = Optimizer> {
    PossibleValuesParser::new(Optimizer::names()).try_map(|name| name.parse::<Optimizer>())
}

fn forms() -> impl TypedValueParser<Value = Form> {
    PossibleValuesParser::new(Form::NAMES).try_map(|name| name.parse::<Form>())
}

fn between_samples() -> impl TypedValueParser<Value = BetweenSamples> {
    let names = [BetweenSamples::Linear, BetweenSamples::BandLimited].map(BetweenSamples::name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<BetweenSamples>())
}

fn bounds(text: &str) -> Result<VariableBounds, String> {
    let parts = text.rsplit_once('=').and_then(|(name, range)| {
        let (low, high) = range.split_once("..")?;
        Some((name, low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?))
    });
    match parts {
        Some((name, lower, upper)) if lower < upper => Ok(VariableBounds { name: name.trim().into(), lower, upper }),
        Some((name, lower, upper)) => {
            Err(format!("bounds of {name}: the lower bound {lower} must be below the upper bound {upper}"))
        }
        None => Err("expected a variable and its bounds; give NAME=LOW..HIGH, for example gamma=0.01..5".into()),
    }
}
