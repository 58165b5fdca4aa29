//! Next steps after a diagnosis: experiments and fits, as commands.

use hyst_ident::diagnose::{Change, RemainderKind, Verdict, drive_options};
use hyst_ident::model::{Effect, Kind};

use hyst_ident::record::Record;

use super::html::Page;
use super::{Contents, words};
use crate::text::listed;

/// Maximum ratio of RMS error and noise floor at which further effects bring little.
const MAX_FLOOR_RATIO: f64 = 2.0;

/// A next step.
#[derive(Debug)]
pub struct Advice {
    /// Purpose of the step, with its reason.
    pub text: String,
    /// Commands to run, in this order.
    pub commands: Vec<String>,
}

/// Writes the next steps.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    let advice = advice(c);
    for Advice { text, commands } in &advice {
        page.paragraph("", text);
        if !commands.is_empty() {
            page.command(&commands.join("\n"));
        }
    }
    if advice.is_empty() {
        page.paragraph("", "No further experiment is needed");
    }
}

/// Returns the next steps.
pub fn advice(c: &Contents<'_>) -> Vec<Advice> {
    let f = &c.diagnosis.findings;
    let mut all = Vec::new();
    let mut advise =
        |text: &str, commands: &[String]| all.push(Advice { text: text.to_owned(), commands: commands.to_vec() });
    for finding in &f.effects {
        for other in finding.ties() {
            let text = format!(
                "This record cannot distinguish {} from {}. Record the drive that separates them best:",
                finding.name, other.name
            );
            advise(&text, &[separate(c, finding.name, other.name)]);
        }
    }
    if words::worse_on_test(f) {
        advise(
            "Record a drive that shows every effect, then fit and diagnose the new record:",
            &[identification(c, "")],
        );
    }
    let rate_dependent = f.effects.iter().any(|e| e.name == Effect::RateDependence);
    let finer = c.model.base.kind() != Kind::Preisach && !rate_dependent;
    if f.remainder.slew_limit.is_some() {
        advise(
            "Record a drive that the amplifier follows, then fit and diagnose that record instead of this one:",
            &[identification(c, "")],
        );
    }
    match f.remainder.kind {
        RemainderKind::Unexplained if f.remainder.slew_limit.is_some() => {}
        RemainderKind::BaseCapacity if f.remainder.change == Some(Change::Zero) => {
            let (files, test) = (files(c.train), test_option(c));
            let reading = further(&c.reading);
            let model = quoted(c.model_path);
            advise(
                "Estimate one sensor zero per record from its measured output:",
                &[format!("hystctl diagnose {files}{test}{reading} --zero per-record --model {model}")],
            );
        }
        RemainderKind::BaseCapacity if f.remainder.change == Some(Change::Device) => {
            let (files, test) = (files(c.train), test_option(c));
            let (reading, kind) = (further(&c.reading), c.model.base.kind().name());
            advise(
                "Fit the same kind of model to the changed device and diagnose it:",
                &[
                    format!("hystctl fit {files}{reading} --model {kind} -o refitted.json"),
                    format!("hystctl diagnose {files}{test}{reading} --model refitted.json -o refitted-extended.json"),
                ],
            );
            advise(
                "If this record does not show every effect, first record a drive that does:",
                &[identification(c, "")],
            );
        }
        // A few loops of a run contain less information than the record of the fit.
        RemainderKind::BaseCapacity if finer && !c.model.fitted_on.is_empty() && !c.model.was_fitted_to(c.train) => {
            let names: Vec<String> = c.model.fitted_on.iter().map(|file| quoted(&file.file)).collect();
            advise(
                "Most of the remainder is misfit of the base model. Fit a finer base model to the records that this model was \
                 fitted to (in their folder, with the same --map) or to a new record of the whole range:",
                &[format!("hystctl fit {} --model preisach -o finer.json", names.join(" "))],
            );
        }
        RemainderKind::BaseCapacity if finer => {
            let (files, test) = (files(c.train), test_option(c));
            let reading = further(&c.reading);
            advise(
                "Most of the remainder is misfit of the base model. Fit a finer base model and diagnose it:",
                &[
                    format!("hystctl fit {files}{reading} --model preisach -o finer.json"),
                    format!(
                        "hystctl diagnose {files}{test}{reading} --model finer.json -o finer-extended.json --report finer.html"
                    ),
                ],
            );
        }
        RemainderKind::BaseCapacity => {
            advise("Most of the remainder is misfit of the base model, and no finer base model can be diagnosed.", &[]);
        }
        RemainderKind::Unexplained
            if f.verdict == Verdict::Explained
                && f.after.train.is_some_and(|e| e.rmse <= MAX_FLOOR_RATIO * f.noise_floor) =>
        {
            advise(
                "The remainder is within twice the noise floor: further effects would reduce it only a little.",
                &[],
            );
        }
        RemainderKind::Unexplained => {
            let missing: Vec<&str> = [
                (c.train.temperature().is_none(), "the temperature (temperature_degc)"),
                (c.train.load().is_none(), "the load (load_n)"),
            ]
            .into_iter()
            .filter_map(|(missing, name)| missing.then_some(name))
            .collect();
            if !missing.is_empty() {
                advise(&format!("Record {} as well, then fit and diagnose again.", listed(&missing)), &[]);
            }
            advise(
                "Play the same drive twice and compare the residuals. The part that repeats comes from the device; the part that \
                 does not repeat is a disturbance that no model can predict.",
                &[],
            );
        }
        RemainderKind::None => {}
    }
    if c.test.is_none()
        && f.remainder.slew_limit.is_none()
        && matches!(f.verdict, Verdict::NothingMissing | Verdict::Explained)
    {
        advise("Test the model on a drive that it was not fitted to:", &[identification(c, " --test")]);
    }
    if let (Some(extended), Verdict::Explained | Verdict::NothingMissing) = (c.extended_file, f.verdict)
        && !words::worse_on_test(f)
        // The model is not useful while the amplifier does not follow the drive.
        && f.remainder.slew_limit.is_none()
    {
        let command = format!("hystctl compensate --model {} reference.csv -o drive.csv", quoted(extended));
        advise("Compute the drive that makes the actuator follow a reference:", &[command]);
    }
    all
}

/// Returns the names of the training files as arguments of a command.
pub fn files(train: &Record) -> String {
    train.sources().iter().map(|s| quoted(&s.name)).collect::<Vec<_>>().join(" ")
}

/// Returns the option `--test FILE` with a space before it, or nothing.
fn test_option(c: &Contents<'_>) -> String {
    c.test.map_or_else(String::new, |t| format!(" --test {}", quoted(&t.name())))
}

/// Returns one argument of a command, quoted for a shell if necessary.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/+:=,@".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// Returns arguments of a command, each quoted and with a space before it.
pub fn further(words: &[String]) -> String {
    words.iter().map(|word| format!(" {}", quoted(word))).collect()
}

fn limits(c: &Contents<'_>) -> String {
    drive_options(c.model, c.train.sample_period(), c.diagnosis.findings.remainder.slew_limit)
}

fn separate(c: &Contents<'_>, one: Effect, other: Effect) -> String {
    let sensors = [(c.train.temperature().is_some(), " --thermometer"), (c.train.load().is_some(), " --load-cell")];
    let sensors: String = sensors.into_iter().filter_map(|(has, option)| has.then_some(option)).collect();
    format!("hystctl excite separate {one} {other} {}{sensors} -o next.csv", limits(c))
}

fn identification(c: &Contents<'_>, more: &str) -> String {
    format!("hystctl excite identification {}{more} -o next.csv", limits(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_quoted_for_a_shell() {
        assert_eq!(quoted("train.csv"), "train.csv");
        assert_eq!(quoted("my record;rm.csv"), "'my record;rm.csv'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(further(&["--map".into(), "u (V)=voltage_v".into()]), " --map 'u (V)=voltage_v'");
        assert_eq!(further(&[]), "");
    }
}
