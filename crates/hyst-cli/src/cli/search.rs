//! Arguments of the search behind a fit.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use hyst_ident::BetweenSamples;
use hyst_ident::fit::{FitOptions, Optimizer, VariableBounds};
use hyst_ident::identify::Form;

use crate::exit::CommandError;

/// How a fit goes about it.
#[derive(Debug, Args)]
pub(crate) struct SearchArgs {
    /// How to go about it; auto says what it chose and why
    #[arg(long, value_name = "WAY", default_value = "auto", value_parser = optimizers())]
    pub(crate) optimizer: Optimizer,
    /// Seed of what is drawn at random, kept in the model; 1 with auto and convex
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// How often to repeat a search with other draws; the best is taken
    #[arg(long, default_value_t = 1)]
    pub(crate) trials: usize,
    /// Most evaluations of a trial; 1500 for each searched variable if not given, 200 with bouc-wen-oscillator
    #[arg(long, value_name = "COUNT")]
    pub(crate) evaluations: Option<u64>,
    /// Members, particles or wolves; the search's own number if not given
    #[arg(long, value_name = "COUNT")]
    pub(crate) population: Option<usize>,
    /// Bounds of a searched variable instead of those that the record suggests; can be repeated
    #[arg(long, value_name = "NAME=LOW..HIGH", value_parser = bounds, allow_hyphen_values = true)]
    pub(crate) bounds: Vec<VariableBounds>,
    /// Form of bouc-wen (zhu: n = 1; xie: n is searched) or of an element of maxwell-slip (backlash, elasto-slip)
    #[arg(long, value_parser = forms())]
    pub(crate) form: Option<Form>,
    /// How the drive of bouc-wen-oscillator goes on between samples: on straight lines, or as the band-limited signal through
    /// them; both are tried if not given, and the one that leaves less of the records is taken and kept in the model
    #[arg(long, value_parser = between_samples())]
    pub(crate) between_samples: Option<BetweenSamples>,
    /// Plays of gpi and td-pi, of pi when it is searched; elements of td-em; most elements of maxwell-slip
    #[arg(long, value_name = "COUNT")]
    pub(crate) elements: Option<usize>,
    /// Most thresholds of pi, chosen where the record calls for them; not given, they are even ones unless some that are no
    /// more predict parts of the record clearly better
    #[arg(long, value_name = "COUNT")]
    pub(crate) thresholds: Option<usize>,
}

impl SearchArgs {
    /// As options of a fit.
    pub(crate) fn options(&self, zero_per_record: bool) -> Result<FitOptions, CommandError> {
        let seed = match (&self.optimizer, self.seed) {
            (_, Some(seed)) => seed,
            (Optimizer::Search(name), None) => {
                return Err(CommandError::bad_input(format!(
                    "--optimizer {name} draws at random: give --seed N, so that it can be repeated"
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
            Err(format!("bounds of {name}: the lower one ({lower}) has to be below the upper one ({upper})"))
        }
        None => Err("give the name of a variable and its bounds, as gamma=0.01..5".into()),
    }
}
