//! `fleet`: fits and diagnoses many actuators; writes one table and one page.

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use hyst_ident::simulate::Zero;
use hyst_ident::stop::Stop;
use serde::Serialize;

use crate::cli::FleetArgs;
use crate::exit::{CommandError, CommandResult};
use crate::fleet::journal::Journal;
use crate::fleet::{self, Entry, Options, Row, entries, one, page, table};
use crate::output::{self, Report, Target};
use crate::progress::Progress;
use crate::{hosted, text};

/// Report of a fleet.
#[derive(Debug, Serialize)]
struct Summary {
    actuators: usize,
    /// Actuators finished by this call and earlier ones.
    done: usize,
    failed: usize,
    /// Actuators finished by earlier calls.
    kept: usize,
    seconds: f64,
    output: String,
    journal: String,
    page: Option<String>,
    /// One line for each of the first finished actuators. The journal has all results as JSON.
    #[serde(skip)]
    lines: Vec<String>,
}

/// Maximum number of actuators that are printed.
const MAX_PRINTED: usize = 100;
/// Maximum interval between updates of the progress bar.
const BAR_INTERVAL: Duration = Duration::from_millis(200);

/// Runs the command.
pub(super) fn run(args: &FleetArgs) -> CommandResult {
    let path = args.output.clone();
    let (output, summary) = (Target::File(path.clone()), args.page.clone().map(Target::File));
    let written: Vec<&Target> = std::iter::once(&output).chain(&summary).collect();
    output::check(&[&args.records], &written)?;
    let report = Report::new(args.json.json, &written)?;
    let all = entries::of(&args.records, &args.output).map_err(CommandError::bad_input)?;
    let options = Options {
        model: args.model.clone(),
        zero_per_record: args.zero.get() == Zero::PerRecord,
        seed: args.seed,
        map: args.map.map.clone(),
        rate: args.map.rate,
        reports: args.reports.clone(),
    };
    options.check().map_err(CommandError::bad_input)?;
    if let Some(folder) = &args.reports {
        std::fs::create_dir_all(folder)?;
    }
    let place = fleet::journal_of(&path);
    let in_journal = |error: io::Error| CommandError::bad_input(format!("{}: {error}", place.display()));
    let mut journal = Journal::open(&place).map_err(in_journal)?;
    let began = Instant::now();
    let bar = Progress::bar("checking files", all.len());
    let due = fleet::due(&all, &journal, &options, &mut |k| bar.at(k));
    drop(bar);
    let kept = all.len() - due.len();
    let outdated = due.iter().filter(|entry| journal.is_of_other_version(entry)).count();
    if outdated > 0 {
        output::say(&format!(
            "note: {} finished by another version of hystctl; this version computes them again",
            text::count(outdated, "actuator")
        ));
    }
    if kept > 0 {
        output::say(&format!("note: {} already finished, see {}", text::count(kept, "actuator"), place.display()));
    }
    let jobs = args.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from));
    let journaled = work(&due, &options, jobs, &mut |row| journal.add(row));
    // The finished actuators are written even if the journal failed.
    output.write(|out| table::write(out, &journal, &all))?;
    if let Some(target) = &summary {
        let html = page::page(&page::title(&args.records), &journal, &all, folder(target))?;
        target.write(|out| out.write_all(html.as_bytes()))?;
    }
    journaled.map_err(in_journal)?;
    let (done, failed) = journal.count(&all);
    let summary = Summary {
        actuators: all.len(),
        done,
        failed,
        kept,
        seconds: began.elapsed().as_secs_f64(),
        output: path.display().to_string(),
        journal: place.display().to_string(),
        page: args.page.as_ref().map(|path| path.display().to_string()),
        lines: journal.rows(&all)?.take(MAX_PRINTED).map(|row| Ok(line(&row?.1))).collect::<io::Result<_>>()?,
    };
    report.print(&summary.text(), &summary)?;
    if hosted::stopping().is_stopped() {
        Err(CommandError::failed("stopped; run the same command again to continue"))
    } else {
        Ok(())
    }
}

/// Processes the actuators that are due, with one thread for each job, and passes each row to `keep`.
fn work(due: &[Entry], options: &Options, jobs: usize, keep: &mut dyn FnMut(&Row) -> io::Result<()>) -> io::Result<()> {
    let (next, stop) = (AtomicUsize::new(0), hosted::stopping());
    let lost = Stop::default();
    let bar = Progress::bar("diagnosing", due.len());
    let (rows, finished) = channel();
    thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, due.len().max(1)) {
            let (rows, next, stop, lost) = (rows.clone(), &next, &stop, &lost);
            scope.spawn(move || {
                // Each actuator is processed by one thread: several actuators in parallel need no synchronisation.
                let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(1).build() else { return };
                while let Some(entry) = due.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let row = pool.install(|| one::row(entry, options, stop));
                    if row.is_none_or(|row| rows.send(row).is_err()) || lost.is_stopped() {
                        break;
                    }
                }
            });
        }
        drop(rows);
        let mut done = 0;
        let mut kept = Ok(());
        loop {
            match finished.recv_timeout(BAR_INTERVAL) {
                Ok(row) => {
                    done += 1;
                    bar.at(done);
                    if let (Ok(()), Err(error)) = (&kept, keep(&row)) {
                        kept = Err(error);
                        lost.stop();
                    }
                }
                Err(std::sync::mpsc::RecvTimeoutError::Timeout) => bar.at(done),
                Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break,
            }
        }
        kept
    })
}

/// Returns the folder of the page.
fn folder(page: &Target) -> &Path {
    page.file().and_then(Path::parent).unwrap_or(Path::new(""))
}

/// Returns the result of an actuator in one line: its name, verdict and effects, or the reason of a failure.
fn line(row: &Row) -> String {
    let name = page::name(&row.entry);
    let found = match &row.outcome {
        Ok(found) => found,
        Err(why) => {
            // A reason of several lines becomes one line, and does not repeat the name of the file.
            let why = why.split_whitespace().collect::<Vec<_>>().join(" ");
            let why =
                why.strip_prefix(&row.entry.file).map_or(why.as_str(), |why| why.trim_start_matches([':', ',', ' ']));
            return format!("{name}: failed: {why}");
        }
    };
    let effects: Vec<&str> = found.effects.iter().map(|effect| effect.name.as_str()).collect();
    let effects = if effects.is_empty() { String::new() } else { format!(": {}", text::listed(&effects)) };
    let report = found.report_error.as_ref().map_or_else(String::new, |why| format!("; no report: {why}"));
    format!("{name}: {}{effects}{report}", found.verdict)
}

impl Summary {
    fn text(&self) -> String {
        let mut lines = self.lines.clone();
        if self.done > lines.len() {
            lines.push(format!("{} more: see {}", self.done - lines.len(), self.output));
        }
        lines.push(format!(
            "{} of {} finished ({} in this call, in {} s), {} without a diagnosis",
            self.done,
            text::count(self.actuators, "actuator"),
            self.done - self.kept.min(self.done),
            text::short(self.seconds),
            self.failed
        ));
        lines.push(format!("results: {}", self.output));
        lines.extend(self.page.iter().map(|path| format!("page: {path}")));
        lines.join("\n")
    }
}
