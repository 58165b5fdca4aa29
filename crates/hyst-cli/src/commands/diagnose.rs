//! `diagnose`: finds the missing effects of a model.

use std::path::Path;

use hyst_ident::diagnose::{DiagnoseOptions, diagnose_until};
use hyst_ident::model::Model;
use hyst_ident::record::{Need, Record};
use sha2::{Digest, Sha256};

use crate::auto_model::{AUTO, fitted_and_diagnosed};
use crate::cli::DiagnoseArgs;
use crate::exit::{CommandError, CommandResult};
use crate::hosted;
use crate::output::{self, Report, Target, say};
use crate::progress::Progress;
use crate::report::{self, Contents, next};
use crate::{input, text};

mod summary;

/// Runs the command.
pub(super) fn run(args: &DiagnoseArgs) -> CommandResult {
    let mut read: Vec<&Path> = args.train.iter().map(AsRef::as_ref).collect();
    let is_auto = args.model == Path::new(AUTO);
    if !is_auto {
        read.push(&args.model);
    }
    read.extend(args.test.as_deref());
    let written: Vec<&Target> = args.output.iter().chain(&args.findings).chain(&args.report).collect();
    output::check(&read, &written)?;
    let report_to = Report::new(args.json.json, &written)?;
    let given = if is_auto { None } else { Some(input::model(&args.model)?) };
    let train = input::training(&args.train, &args.map)?;
    let test = args.test.as_ref().map(|path| input::record(path, &args.map, Need::InputAndOutput)).transpose()?;
    let options = DiagnoseOptions { zero: args.zero.get(), seed: args.seed };
    let (model, model_text, diagnosis) = match given {
        Some((model, text)) => {
            warn(&model, &train, test.as_ref());
            let progress = Progress::spinner("diagnosing");
            let diagnosis = diagnose_until(
                &train,
                test.as_ref(),
                &model,
                &options,
                &|doing| progress.set_message(doing),
                &hosted::stopping(),
            )?;
            (model, text, diagnosis)
        }
        None => {
            let progress = Progress::spinner("fitting and diagnosing");
            let report = |doing: &str| progress.set_message(doing);
            fitted_and_diagnosed(&train, test.as_ref(), None, &options, &report, &hosted::stopping())?
        }
    };

    let findings = &diagnosis.findings;
    if let Some(target) = &args.output {
        target.write(|out| out.write_all(diagnosis.extended.to_json().as_bytes()))?;
    }
    if let Some(target) = &args.findings {
        let json = output::json(findings)?;
        target.write(|out| out.write_all(json.as_bytes()))?;
    }
    let extended_file = args.output.as_ref().and_then(Target::file).map(|path| path.display().to_string());
    let contents = Contents {
        diagnosis: &diagnosis,
        model: &model,
        model_file: &args.model.file_name().map_or_else(|| "model".into(), |name| name.to_string_lossy()),
        model_path: &args.model.display().to_string(),
        model_sha256: &format!("{:x}", Sha256::digest(&model_text)),
        extended_file: extended_file.as_deref(),
        train: &train,
        test: test.as_ref(),
        reading: input::reading(&args.map, &args.zero),
        seed: args.seed,
    };
    if let Some(target) = &args.report {
        let page = report::page(&contents).map_err(CommandError::failed)?;
        target.write(|out| out.write_all(page.as_bytes()))?;
    }
    let mut text = summary::of(findings, &next::advice(&contents));
    let same = diagnosis.extended == model;
    let model_written = if same { "unchanged model, no effect was added" } else { "extended model" };
    for (target, what) in [(&args.output, model_written), (&args.findings, "findings"), (&args.report, "report")] {
        if let Some(Target::File(path)) = target {
            text.push_str(&format!("\n{what}: {}", path.display()));
        }
    }
    report_to.print(&text, findings)
}

/// Prints notes about records that make the errors or the named effects unreliable.
fn warn(model: &Model, train: &Record, test: Option<&Record>) {
    let fitted = |sha: &str| model.fitted_on.iter().any(|file| file.sha256 == sha);
    let not_fitted: Vec<&str> = train
        .sources()
        .iter()
        .filter(|source| source.sha256.as_deref().is_some_and(|sha| !fitted(sha)))
        .map(|source| source.name.as_str())
        .collect();
    if !not_fitted.is_empty() {
        let names = text::listed(&not_fitted);
        say(&format!("note: the model was not fitted to {names}; its misfit there may be named as an effect"));
    }
    match test {
        Some(test) if model.was_fitted_to(test) || input::is_trained_on(test, train) => say(input::TRAINED_ON),
        Some(test) => input::print_repeated(test, train),
        None => {}
    }
}
