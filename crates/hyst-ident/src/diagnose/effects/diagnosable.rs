//! What a diagnosis knows about one effect.

use hyst_core::Error;

use super::kind::EffectKind;
use crate::diagnose::context::{Context, Put};
use crate::diagnose::evidence::picture::Picture;
use crate::diagnose::evidence::scene::Scene;
use crate::diagnose::limit::{Limit, Limits};
use crate::diagnose::scan::Scan;
use crate::model::{Effect, Effects, Model};
use crate::nested::{Fitted, Hypothesis, Problem};

/// An effect that a diagnosis can name.
///
/// Every question of the diagnosis that depends on the effect is a method. The search, the judgement and the report ask
/// these methods and know no effect by name.
pub(in crate::diagnose) trait Diagnosable: Sync {
    /// The effect.
    fn effect(&self) -> Effect;

    /// Class of the effect.
    fn kind(&self) -> EffectKind;

    /// Returns why a record cannot show the effect; `None` if it can.
    fn hidden(&self, _problem: &Problem<'_>) -> Option<&'static str> {
        None
    }

    /// Whether the effect delays the output.
    fn is_late(&self) -> bool {
        false
    }

    /// Returns the first-order columns of the effect; `None` if its start is searched first.
    fn columns(&self, _scan: &Scan<'_>) -> Result<Option<Vec<Vec<f64>>>, Error> {
        Ok(None)
    }

    /// Returns the hypotheses from which the search of the effect's parameters starts, added to the scanned fit.
    fn starts(&self, scan: &Scan<'_>) -> Result<Vec<Hypothesis>, Error>;

    /// Returns the limit of detection, if the record can show the effect; `None` for an effect that is searched
    /// elsewhere.
    fn limit(&self, limits: &Limits<'_>) -> Result<Option<Limit>, Error>;

    /// Returns whether the parameters of the effect in a fit, if it has the effect, are physically plausible.
    fn is_plausible(&self, problem: &Problem<'_>, fit: &Fitted) -> bool;

    /// Returns whether the record does not determine the effect. `unsure` returns whether a parameter
    /// (`stage.parameter`, value) differs from zero by too few standard errors; `span` is the range of the output.
    fn is_undetermined(&self, effects: &Effects, unsure: &dyn Fn(&str, f64) -> bool, span: f64) -> bool;

    /// Returns the name of the law that the effect follows in a model; `None` for a flexible form.
    fn law(&self, model: &Model) -> Option<&'static str>;

    /// Describes the effect so that a person can check it on the device.
    fn signature(&self, context: &Context<'_>) -> Option<String>;

    /// Passes the parameters of the effect to `put`: stage, name, value and unit.
    fn parameters(&self, context: &Context<'_>, put: &mut Put<'_>);

    /// Returns the model without the effect.
    fn without(&self, model: &Model) -> Model {
        Model { effects: model.effects.without(self.effect()), ..model.clone() }
    }

    /// Returns pictures of the trace that the effect leaves in the record.
    fn pictures(&self, model: &Model, scene: &Scene<'_>) -> Vec<Picture>;
}
