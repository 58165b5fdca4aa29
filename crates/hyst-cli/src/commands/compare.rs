//! `compare`: fits all kinds of models to a record and compares their errors.

mod picture;

use std::path::Path;

use hyst_ident::compare::{Compared, Comparison, Figures, Skipped, SortedBy, Step, compare};
use hyst_ident::record::{Need, Record};
use hyst_ident::simulate::Zero;
use serde::Serialize;

use crate::canvas::Format;
use crate::cli::CompareArgs;
use crate::exit::CommandResult;
use crate::hosted;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::report::next::{files, further, quoted};
use crate::{input, text};

/// Report of a comparison.
#[derive(Debug, Serialize)]
struct Summary {
    train: String,
    /// Commands that find the missing effects of the best model.
    #[serde(skip)]
    next: Vec<String>,
    rows: usize,
    /// Start-up rows of at least one of the models, which are left out for all.
    settling_rows: usize,
    test: Option<String>,
    test_rows: Option<usize>,
    test_settling_rows: Option<usize>,
    unit: String,
    zero: Zero,
    seed: u64,
    /// Whether the test record is one of the training records.
    #[serde(skip)]
    trained_on: bool,
    #[serde(flatten)]
    comparison: Comparison,
}

/// Runs the command.
pub(super) fn run(args: &CompareArgs) -> CommandResult {
    let read: Vec<&Path> = args.train.iter().chain(&args.test).map(AsRef::as_ref).collect();
    let written: Vec<_> = args.picture.iter().collect();
    output::check(&read, &written)?;
    args.picture.as_ref().map(Format::of).transpose()?;
    let report = Report::new(args.json.json, &written)?;
    let train = input::training(&args.train, &args.map)?;
    let test = args.test.as_ref().map(|path| input::record(path, &args.map, Need::InputAndOutput)).transpose()?;
    let trained_on = test.as_ref().is_some_and(|test| input::is_trained_on(test, &train));
    match &test {
        Some(_) if trained_on => output::say(input::TRAINED_ON),
        Some(test) => input::print_repeated(test, &train),
        None => {}
    }
    let zero = args.zero.get();
    let options = args.options(zero == Zero::PerRecord);

    let progress = Progress::bar("comparing", args.models.0.len());
    let comparison = compare(&train, test.as_ref(), &args.models.0, &options, &mut |step: Step| {
        progress.at(step.done);
        progress.set_message(&match step.evaluations {
            (0, _) => format!("fitting {}", step.kind),
            (done, budget) => format!("fitting {}: {done} of at most {budget} evaluations", step.kind),
        });
        hosted::going()
    })?;
    drop(progress);

    if let Some(target) = &args.picture {
        let (record, predicted): (_, fn(&Compared) -> &[f64]) = match &test {
            Some(test) => (test, |model| &model.test_predicted),
            None => (&train, |model| &model.train_predicted),
        };
        let picture = picture::draw(Format::of(target)?, &comparison, record, predicted)?;
        target.write(|out| out.write_all(&picture))?;
    }
    let settling = |rows: &[bool]| rows.iter().filter(|settling| **settling).count();
    let summary = Summary {
        train: train.name(),
        next: comparison.models.first().map_or_else(Vec::new, |best| next(args, &train, test.as_ref(), best)),
        rows: train.rows(),
        settling_rows: settling(&comparison.train_settling),
        test_rows: test.as_ref().map(Record::rows),
        test_settling_rows: test.as_ref().map(|_| settling(&comparison.test_settling)),
        test: test.map(|test| test.name()),
        unit: train.output_unit().map_or("", |unit| unit.suffix()).to_owned(),
        zero,
        seed: args.seed,
        trained_on,
        comparison,
    };
    report.print(&summary.text(), &summary)
}

impl Summary {
    fn text(&self) -> String {
        let unit = text::symbol(&self.unit);
        let rows = |name: &str, rows: usize, settling: usize| {
            format!("{name}: {} (start-up rows of any model, left out for all: {settling})", text::count(rows, "row"))
        };
        let mut lines = vec![format!("fitted to {}", rows(&self.train, self.rows, self.settling_rows))];
        if let (Some(name), Some(count), Some(settling)) = (&self.test, self.test_rows, self.test_settling_rows) {
            lines.push(format!("tested on {}", rows(name, count, settling)));
        }
        lines.push(String::new());
        lines.push(table(&self.comparison, unit));
        lines.push(match self.comparison.sorted_by {
            SortedBy::TestRmse if self.trained_on => "sorted by RMSE on a record that the models were fitted to".to_owned(),
            SortedBy::TestRmse => "sorted by RMSE on the test record, which no model was fitted to".to_owned(),
            SortedBy::TrainRmse => {
                "sorted by RMSE on the training record, which always falls with more parameters; --test RECORD compares on new data"
                    .to_owned()
            }
        });
        for m in &self.comparison.models {
            if let Some(names) = m.undetermined.as_ref().filter(|names| !names.is_empty()) {
                lines.push(format!("{}: not determined by the record: {}", m.kind, text::listed(names)));
            }
        }
        for m in &self.comparison.models {
            lines.extend(m.tables.iter().map(|table| format!("{}: {}", m.kind, text::known(table))));
        }
        for Skipped { kind, reason } in &self.comparison.skipped {
            lines.push(format!("skipped {kind}: {reason}"));
        }
        if !self.next.is_empty() {
            lines.push(
                "these models describe only the hysteresis; their order can change when missing effects are added (creep, \
                 resonance, temperature …). Find the missing effects of the first model:"
                    .to_owned(),
            );
            lines.extend(self.next.iter().map(|command| format!("  {command}")));
        }
        lines.join("\n")
    }
}

/// Returns commands that fit and diagnose one of the models as it was compared.
fn next(args: &CompareArgs, train: &Record, test: Option<&Record>, best: &Compared) -> Vec<String> {
    let (files, reading) = (files(train), further(&input::reading(&args.map, &args.zero)));
    let mut fit = Vec::new();
    for (option, value, usual) in [("--seed", args.seed, 1), ("--trials", args.trials as u64, 1)] {
        if value != usual {
            fit.extend([option.to_owned(), value.to_string()]);
        }
    }
    if let Some(evaluations) = args.evaluations {
        fit.extend(["--evaluations".to_owned(), evaluations.to_string()]);
    }
    let test = test.map_or_else(String::new, |test| format!(" --test {}", quoted(&test.name())));
    let (kind, fit) = (best.kind, further(&fit));
    vec![
        format!("hystctl fit {files}{reading} --model {kind}{fit} -o model.json"),
        format!("hystctl diagnose {files}{test}{reading} --model model.json -o extended.json --report report.html"),
    ]
}

/// Returns the table of errors, with one line for each model and record.
fn table(comparison: &Comparison, unit: &str) -> String {
    let head = ["model", "on", "RMSE", "of span", "max", "PV", "MAPE", "without", "SMAPE", "params", "undet.", "fit"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.push(["", "", unit, "", unit, unit, "", "rows", "", "", "", "s"].map(str::to_owned).to_vec());
    for m in &comparison.models {
        let of_tables = m.tables.iter().map(|t| t.vague() + t.untouched).sum::<usize>().to_string();
        let undetermined = m.undetermined.as_ref().map_or(of_tables, |names| names.len().to_string());
        let once = [m.parameters.to_string(), undetermined, format!("{:.2}", m.fit_seconds)];
        match &m.test {
            Some(test) => {
                rows.push(line(m.kind.name(), "test", test, &once));
                rows.push(line("", "train", &m.train, &[]));
            }
            None => rows.push(line(m.kind.name(), "train", &m.train, &once)),
        }
    }
    text::table(&rows)
}

fn line(name: &str, on: &str, figures: &Figures, more: &[String]) -> Vec<String> {
    let Figures { errors, mape, smape, peak_to_valley } = figures;
    let mut cells = vec![
        name.to_owned(),
        on.to_owned(),
        text::short(errors.rmse),
        text::percent(errors.nrmse_percent),
        text::short(errors.max_abs),
        text::short(*peak_to_valley),
        mape.ratio.map_or_else(|| "none".to_owned(), |ratio| text::percent(100.0 * ratio)),
        mape.left_out.to_string(),
        text::percent(100.0 * smape),
    ];
    cells.extend(more.iter().cloned());
    cells
}
