//! The steps of a diagnosis, in order.

use super::curve_search::CurveSearch;
use super::diagnosis::{DiagnoseOptions, Diagnosis};
use super::findings::{Remainder, RemainderKind};
use super::own_model::OwnModel;
use super::probability::Weighed;
use super::rail::Rail;
use super::settled::{Settled, unless_followed};
use super::trial::Trial;
use super::{
    advice, changed, collect, evidence, extension, finer, limits, own_base, remainder, rows, search, shape, suspects,
    uncertainty,
};
use crate::base::{Basis, DragParams, PiBasis, ROWS_PER_UNKNOWN, ScreeningBasis};
use crate::fit::{BasisOf, FitError, FitOptions, basis_of, check, fit_settled, sign_matters};
use crate::lsq::{BLOCKS, Blocks};
use crate::model::{Base, Effect, Model};
use crate::nested::{Hypothesis, Problem};
use crate::record::Record;
use crate::repetition::only_loop;
use crate::samples::Samples;
use crate::settle::start_up_rows;
use crate::simulate::{Zero, simulate};
use crate::stop::Stop;

/// Maximum number of rows of the search.
const SEARCH_ROWS: usize = 16_000;
/// Maximum number of rounds in which a new saturation limit and the thresholds of the base are fitted in turn.
const STOP_ROUNDS: usize = 3;

/// Runs all steps of a diagnosis. The arguments are those of `diagnose_until`.
pub(super) fn found_in(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Stop,
) -> Result<Diagnosis, FitError> {
    let before = simulate(model, train, options.zero)?;
    let mut samples = Samples { stop: stop.clone(), ..Samples::from_record(train) };
    samples.falls &= sign_matters(model.base.kind());
    check(train, &samples, samples.falls != model.falls)?;
    let stage = |source| FitError::Stage { record: train.name(), source };
    let per_record = options.zero == Zero::PerRecord;

    let own = basis_of(model, &samples).map_err(stage)?;
    let kept = match &own {
        BasisOf::Linearised(kept) => Some(Box::new(kept.alone())),
        _ => None,
    };
    let start = hypothesis_of(model);
    // A linearised operator is not searched: far from its parameters its linearisation error looks like effects. Where a
    // curve is searched, play operators stand in.
    let is_searched = !matches!(own, BasisOf::Linearised(_));
    let only_loop = only_loop(&samples);
    let stand_in = (!is_searched && only_loop.is_none()).then(|| BasisOf::Pi(PiBasis::finer(&samples)));
    let curve_basis =
        |own| Some(stand_in.as_ref().unwrap_or(own)).filter(|b| b.as_ref().is_odd() && only_loop.is_none());
    let rail = match curve_basis(&own) {
        Some(basis) => {
            progress("checking whether the output ignores a part of the drive");
            OwnModel { model, train, samples: &samples, basis, before: &before, per_record }
                .rail(&start, options.seed)?
        }
        None => None,
    };
    // All steps of the search see the limited drive.
    let asked = samples.input.clone();
    if let Some(rail) = &rail {
        samples.input = rail.given(&samples).map_err(stage)?;
    }
    let screening = ScreeningBasis::for_samples(&samples, own.as_ref().drags(), kept);
    // Start-up rows are rows that the screening basis does not follow either. A misfit of a coarse base alone is no
    // transient.
    let fitting = FitOptions { zero_per_record: per_record, ..FitOptions::default() };
    fit_settled(&mut samples, &screening, &fitting, &|| train.name())?;
    // Rows that the model itself follows are no start-up rows: the screening basis, fitted without them, is
    // undetermined there. Exception: segments that the model follows only after a drive history that the search does
    // not know.
    for ((segment, in_mid_cycle), past) in samples.segments.iter().zip(&before.in_mid_cycle).zip(&samples.pasts) {
        for k in segment.clone().filter(|_| !in_mid_cycle || !past.is_empty()) {
            samples.settling[k] &= before.settling[k] || samples.blind[k];
        }
    }
    let (rows, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_PER_UNKNOWN * screening.len());
    if rows < needed {
        return Err(FitError::TooShort { record: train.name(), rows, unknowns: screening.len(), needed });
    }
    let unsolvable = || FitError::Unsolvable { record: train.name() };
    let blocks = Blocks::new(&samples, BLOCKS, SEARCH_ROWS);
    let searched_too = is_searched.then(|| own.as_ref());
    let base_of = |on_own: bool| searched_too.filter(|_| on_own).unwrap_or(&screening);
    // A search over other rows starts from the result of the previous search.
    let searched = |samples: &Samples, from: &Hypothesis| {
        let problem = Problem::new(samples, &screening, &blocks, per_record);
        let base = problem.fit(from).map_err(stage)?.ok_or_else(unsolvable)?;
        let found = search::search(&problem, base, &start.causes(), options.seed, progress).map_err(stage)?;
        let (mut problem, mut found, mut on_own) = (problem, found, false);
        if let Some(basis) = searched_too {
            let own = Problem::new(samples, basis, &blocks, per_record);
            let start = (from, start.causes());
            let anew = own_base::search(&own, screening.len(), &found, start, options.seed, progress).map_err(stage)?;
            if let Some(anew) = anew {
                (problem, found, on_own) = (own, anew, true);
            }
        }
        let residual = problem.residual(&found.best.fit).map_err(stage)?;
        Ok::<_, FitError>((found, start_up_rows(samples, &residual), on_own))
    };
    let (mut found, starting, mut on_own) = searched(&samples, &start)?;
    // A transient may show only after the missing effects are found.
    if samples.settling.iter().zip(&starting).any(|(known, starts)| *starts && !*known) {
        progress("searching again without the new start-up rows");
        samples.settling.iter_mut().zip(&starting).for_each(|(known, starts)| *known |= *starts);
        (found, _, on_own) = searched(&samples, &found.best.fit.hypothesis)?;
    }
    // An apparent start-up may be a missing effect: a saturation, for example, hides the rise from rest.
    if !found.named.is_empty() {
        let mut seen = samples.clone();
        let known = Settled { fit: found.best.fit.clone(), settling: samples.settling.clone() };
        let followed = unless_followed(&samples, known, &mut |settling: &[bool]| {
            seen.settling.copy_from_slice(settling);
            let problem = Problem::new(&seen, base_of(on_own), &blocks, per_record);
            let Some(fit) = problem.fit(&found.best.fit.hypothesis).map_err(stage)? else { return Ok(None) };
            let starting = start_up_rows(&seen, &problem.residual(&fit).map_err(stage)?);
            Ok::<_, FitError>(Some((fit, starting)))
        })?;
        if followed.settling != samples.settling {
            progress("searching again with the start-up rows that the effects explain");
            samples.settling = followed.settling;
            (found, _, on_own) = searched(&samples, &found.best.fit.hypothesis)?;
        }
    }

    progress("checking the effects on a finer base model");
    let problem = Problem::new(&samples, base_of(on_own), &blocks, per_record);
    let finer::Finer { mut hypothesis, mut errors, cv_rmse: mut richest } =
        finer::refine(&problem, &mut found, &start.causes(), &samples, options.seed, progress).map_err(stage)?;
    // If the model's own base was searched, the screening basis may follow the record even better with the same
    // effects.
    if on_own {
        let rich = Problem::new(&samples, &screening, &blocks, per_record);
        let fit = rich.fit_linear(&hypothesis).map_err(stage)?;
        richest = fit.and_then(|f| Trial::of(&rich, f)).map_or(richest, |rich| richest.min(rich.cv_rmse()));
    }
    // The drift's parameters come from the fit without zero wander. The wander beyond the drift is reported too.
    if let Some(least) = found.cv_rmse_with_wander.filter(|_| hypothesis.effects.drift.is_some()) {
        hypothesis.zero_wanders = true;
        richest = richest.min(least);
    }
    progress("computing the limits of detection");
    let units = (model.input.symbol(), model.output.unit.as_str());
    let with_found = problem.fit_linear(&hypothesis).map_err(stage)?.and_then(|f| Trial::of(&problem, f));
    // Residual on the basis of the search: a finer basis than the model's own has less misfit.
    let found_residual = with_found.as_ref().map(|trial| problem.residual(&trial.fit)).transpose().map_err(stage)?;
    let mut limits = with_found
        .map(|found_here| limits::limits(&problem, &found_here, found.noise, units).map_err(stage))
        .transpose()?
        .unwrap_or_default();
    drop(problem);
    let samples = Samples { input: asked, ..samples };
    let mut known = start.clone();
    if let Some(Rail { limits, .. }) = &rail {
        // The chain has one saturation.
        found.named.retain(|n| n.effect != Effect::Saturation);
        hypothesis.effects.saturation = Some(*limits);
        known.effects.saturation = Some(*limits);
    }

    let effects = |h: &Hypothesis| h.causes().iter().filter_map(|c| c.effect()).collect::<Vec<_>>();
    // With the new effects, other thresholds fit better. The saturation limit depends on the thresholds, so both are
    // fitted in turn.
    let mut basis: Option<BasisOf> = None;
    let own_model = OwnModel { model, train, samples: &samples, basis: &own, before: &before, per_record };
    let stop_is_new = hypothesis.effects.saturation.is_some() && start.effects.saturation.is_none();
    if effects(&hypothesis) != effects(&start) {
        basis = own_model.with_better_thresholds(&hypothesis)?;
    }
    for round in (1..=STOP_ROUNDS).filter(|_| stop_is_new) {
        let own_model = OwnModel { basis: basis.as_ref().unwrap_or(&own), ..own_model };
        own_model.stop(&mut hypothesis, &mut errors)?;
        // The last round ends with the saturation limit.
        let better = if round < STOP_ROUNDS { own_model.with_better_thresholds(&hypothesis)? } else { None };
        let Some(better) = better else { break };
        basis = Some(better);
    }
    // The starts of the segments, if they show only together with a curve.
    let mut started: Option<Samples> = None;
    // A base that is not odd bends with its own weights. A curve behind it would take up its misfit.
    if let Some(curve_basis) = curve_basis(basis.as_ref().unwrap_or(&own)) {
        progress("checking the base model for asymmetry and saturation");
        let own_model = OwnModel { basis: curve_basis, ..own_model };
        let find_curve = |effects: &Hypothesis| {
            let with_start = own_model.start_beside_a_curve(effects, richest)?;
            let own_model = OwnModel { samples: with_start.as_ref().unwrap_or(&samples), ..own_model };
            let mut shaped = own_model.shape(&known, effects, richest, found.noise, options.seed, progress)?;
            if stand_in.is_some() {
                shaped = OwnModel { basis: &own, ..own_model }.confirmed_curve(shaped)?;
            }
            Ok::<_, FitError>((with_start, shaped))
        };
        let (mut with_start, mut shaped) = find_curve(&hypothesis)?;
        // The named effects may be no more than the trace of a missing curve.
        let left = |shaped: &CurveSearch| shaped.curve.as_ref().map_or(f64::INFINITY, |(curve, _)| curve.cv_with);
        if left(&shaped) > shape::MAX_RATIO_RESELECTED * richest && shaped.basis.is_none() && !found.named.is_empty() {
            let alone = find_curve(&known)?;
            if left(&alone.1) < left(&shaped) {
                found.named.clear();
                (with_start, shaped) = alone;
            }
        }
        if let Some((curve, fit)) = shaped.curve {
            if let Some(searched) = shaped.searched {
                errors = uncertainty::standard_errors(&searched.best.fit, samples.time[0]);
                found.named = searched.named;
            }
            own_model.take(curve.effect, &fit, &mut errors);
            hypothesis = fit.hypothesis;
            found.named.push(curve);
            found.named.sort_by_key(|n| n.effect);
            started = with_start;
        }
        basis = shaped.basis.or(basis);
    }
    let own_model = OwnModel { samples: started.as_ref().unwrap_or(&samples), ..own_model };
    // With much memory a basis can imitate an effect in a single record. If the model's base with few effects fits as
    // well, that explanation is simpler.
    if found.named.is_empty() && only_loop.is_none() && is_searched {
        progress("searching for effects on the model's own base");
        let own_model = OwnModel { basis: basis.as_ref().unwrap_or(&own), ..own_model };
        if let Some(closing) = own_model.closing(&hypothesis, &known, richest, found.noise, options.seed, progress)? {
            hypothesis = closing.best.fit.hypothesis.clone();
            errors = uncertainty::standard_errors(&closing.best.fit, samples.time[0]);
            found = closing;
            basis = own_model.with_better_thresholds(&hypothesis)?.or(basis);
        }
    }
    let own_model = OwnModel { basis: basis.as_ref().unwrap_or(&own), ..own_model };

    if let Some(Rail { fit, named, .. }) = rail {
        own_model.take(Effect::Saturation, &fit, &mut errors);
        found.named.push(named);
        found.named.sort_by_key(|n| n.effect);
    }
    progress("refitting the model with the effects found");
    let mut extended = model.clone();
    let mut after = before.clone();
    let mut restarted: Option<Samples> = None;
    if effects(&hypothesis) != effects(&start) {
        let found_here = (&hypothesis, &errors);
        let best = own_model.best(&start, found_here, (richest, found.noise, options.seed), options.zero)?;
        extension::Extension { hypothesis, errors, restarted, model: extended, after } = best;
    }
    let own_model = OwnModel { samples: restarted.as_ref().unwrap_or(own_model.samples), ..own_model };

    progress("classifying the remainder");
    let mut useless = Vec::new();
    // A drive that the amplifier does not follow would hide the difference.
    let mut amplified = None;
    if let Some(v_per_s) = hypothesis.slew_limit.filter(|_| !found.named.is_empty()) {
        let record = own_model.amplified(v_per_s);
        amplified = Some((simulate(model, &record, options.zero)?, simulate(&extended, &record, options.zero)?));
    }
    let (without, with) = amplified.as_ref().map_or((&before, &after), |(without, with)| (without, with));
    let helps = || Ok::<_, FitError>(own_model.is_improved(without, with) && own_model.transfers(&start, &hypothesis)?);
    if !found.named.is_empty() && !helps()? {
        // The misfit of the model's base hides what the screening basis shows.
        useless = found.named.drain(..).map(|n| n.effect).collect();
        (extended, after, amplified) = (model.clone(), before.clone(), None);
        let Hypothesis { slew_limit, zero_wanders, gain_wanders, .. } = hypothesis;
        hypothesis = Hypothesis { slew_limit, zero_wanders, gain_wanders, ..start.clone() };
    }
    if extended != *model {
        extended.rmse = after.errors.as_ref().map(|errors| errors.rmse);
    }
    let mut remainder = remainder::judge(&remainder::Material {
        found: &found,
        hypothesis: &hypothesis,
        after: &after,
        amplified: amplified.as_ref(),
        samples: &samples,
        richest,
        on_search_basis: found_residual.as_deref(),
        input: model.input.symbol(),
    });
    if extended == *model {
        let own_model = OwnModel { basis: &own, ..own_model };
        remainder = changed::detect_change(&own_model, &start, found.noise, options.zero, remainder)?;
    }
    let remainder = remainder.with_remarks(only_loop, &useless);
    let tests = test
        .map(|t| Ok::<_, FitError>((simulate(model, t, options.zero)?, simulate(&extended, t, options.zero)?)))
        .transpose()?;
    let mut named: Vec<Effect> = found.named.iter().map(|n| n.effect).collect();
    named.dedup();
    let evidence::Evidence { pictures, breakdowns, places } = evidence::collect(&evidence::Material {
        extended: &extended,
        named: &named,
        train,
        test,
        before: &before,
        after: &after,
        tests: tests.as_ref(),
        zero: options.zero,
        noise: found.noise,
    })?;
    limits.retain(|effect, _| !named.contains(effect));
    // On the basis of the search: the misfit of the model's own base is no evidence against an effect.
    let left = found.best.cv_rmse() / found.noise.max(f64::MIN_POSITIVE);
    let candidates = suspects::candidates(&found, &named, left);
    let suspects = suspects::suspects(&candidates, model, &samples, remainder.slew_limit);
    let given = found.named.iter().map(|n| Weighed::of(n.effect, n.ties(), true, &n.evidence(left)));
    let others = candidates.iter().map(|n| Weighed::of(n.effect, Vec::new(), false, &n.evidence));
    let weighed = given.chain(others).collect();
    let base_advice = match remainder.kind {
        RemainderKind::None => None,
        _ => {
            let own = (model.base.kind(), own_model.basis.as_ref());
            advice::base_advice(&samples, own, &hypothesis, per_record, &stage)?
        }
    };
    let findings = collect::findings(&collect::Material {
        left,
        suspects,
        limits,
        base_advice,
        rows: rows::rows(train, &samples),
        model,
        extended: &extended,
        named: &found.named,
        noise: found.noise,
        errors: &errors,
        before: &before,
        after: &after,
        tests: tests.as_ref(),
        remainder: Remainder { places, ..remainder },
        zero: options.zero,
        samples: &samples,
    });
    Ok(Diagnosis { extended, findings, pictures, breakdowns, weighed })
}

/// Returns what a model already contains.
fn hypothesis_of(model: &Model) -> Hypothesis {
    let drag = match &model.base {
        Base::ViscousPi(p) => Some(DragParams { seconds: p.seconds, volt_seconds: p.volt_seconds }),
        _ => None,
    };
    Hypothesis { drag, ..Hypothesis::of(model.effects.clone()) }
}
