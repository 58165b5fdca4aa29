//! The experiment or the fit that would tell more, as a command.

use hyst_ident::diagnose::{Change, RemainderKind, Verdict, drive_options};
use hyst_ident::model::{Effect, Kind};

use hyst_ident::record::Record;

use super::html::Page;
use super::{Contents, words};
use crate::text::listed;

/// Up to so many noise floors of error there is little left to look for.
const NEAR_THE_FLOOR: f64 = 2.0;

/// What to do next, and why.
#[derive(Debug)]
pub struct Advice {
    /// Why, and what it is for.
    pub text: String,
    /// Commands, in the order in which they are to be run.
    pub commands: Vec<String>,
}

/// Writes what to do next.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    let advice = advice(c);
    for Advice { text, commands } in &advice {
        page.paragraph("", text);
        if !commands.is_empty() {
            page.command(&commands.join("\n"));
        }
    }
    if advice.is_empty() {
        page.paragraph("", "Nothing that another experiment would have to settle");
    }
}

/// What to do next.
pub fn advice(c: &Contents<'_>) -> Vec<Advice> {
    let f = &c.diagnosis.findings;
    let mut all = Vec::new();
    let mut advise =
        |text: &str, commands: &[String]| all.push(Advice { text: text.to_owned(), commands: commands.to_vec() });
    for finding in &f.effects {
        for other in finding.alternatives.iter().filter(|a| a.indistinguishable) {
            let text = format!(
                "This record cannot tell {} from {}. The drive that leaves most of one that the other cannot imitate:",
                finding.name, other.name
            );
            advise(&text, &[separate(c, finding.name, other.name)]);
        }
    }
    if words::worse_on_test(f) {
        advise("Record a drive that shows every effect, and fit and diagnose that:", &[identification(c, "")]);
    }
    let drags = f.effects.iter().any(|e| e.name == Effect::RateDependence);
    let finer = c.model.base.kind() != Kind::Preisach && !drags;
    if f.remainder.slew_limit.is_some() {
        advise(
            "A drive that the amplifier follows; fit and diagnose its record instead of this one:",
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
                "A zero that each record has of its own is taken from its measured output:",
                &[format!("hystctl diagnose {files}{test}{reading} --zero per-record --model {model}")],
            );
        }
        RemainderKind::BaseCapacity if f.remainder.change == Some(Change::Device) => {
            let (files, test) = (files(c.train), test_option(c));
            let (reading, kind) = (further(&c.reading), c.model.base.kind().name());
            advise(
                "The same kind of model, fitted to what the device is now, and its diagnosis:",
                &[
                    format!("hystctl fit {files}{reading} --model {kind} -o refitted.json"),
                    format!("hystctl diagnose {files}{test}{reading} --model refitted.json -o refitted-extended.json"),
                ],
            );
            advise(
                "Where this record does not show every effect, record one that does before:",
                &[identification(c, "")],
            );
        }
        // A few loops of a run show less than the record of the fit did.
        RemainderKind::BaseCapacity if finer && !c.model.fitted_on.is_empty() && !c.model.was_fitted_to(c.train) => {
            let names: Vec<String> = c.model.fitted_on.iter().map(|file| quoted(&file.file)).collect();
            advise(
                "Most of what is left is the base's own misfit. A finer base is best fitted to what this one was fitted to (from its folder, with the same --map), or to a new record of the whole range:",
                &[format!("hystctl fit {} --model preisach -o finer.json", names.join(" "))],
            );
        }
        RemainderKind::BaseCapacity if finer => {
            let (files, test) = (files(c.train), test_option(c));
            let reading = further(&c.reading);
            advise(
                "Most of what is left is the base's own misfit. A finer base, and its diagnosis:",
                &[
                    format!("hystctl fit {files}{reading} --model preisach -o finer.json"),
                    format!(
                        "hystctl diagnose {files}{test}{reading} --model finer.json -o finer-extended.json --report finer.html"
                    ),
                ],
            );
        }
        RemainderKind::BaseCapacity => {
            advise(
                "Most of what is left is the base's own misfit, and there is no finer base that can be diagnosed.",
                &[],
            );
        }
        RemainderKind::Unexplained
            if f.verdict == Verdict::Explained
                && f.after.train.is_some_and(|e| e.rmse <= NEAR_THE_FLOOR * f.noise_floor) =>
        {
            advise("What is left is within twice the noise floor: there is little to gain from looking further.", &[]);
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
                advise(&format!("Record {} too, and fit and diagnose anew.", listed(&missing)), &[]);
            }
            advise(
                "Play the same drive twice. What comes back in both residuals is the device's; what does not is a disturbance that \
                 no model will take.",
                &[],
            );
        }
        RemainderKind::None => {}
    }
    if c.test.is_none()
        && f.remainder.slew_limit.is_none()
        && matches!(f.verdict, Verdict::NothingMissing | Verdict::Explained)
    {
        advise("See what the model is worth on a drive that it has not seen:", &[identification(c, " --test")]);
    }
    if let (Some(extended), Verdict::Explained | Verdict::NothingMissing) = (c.extended_file, f.verdict)
        && !words::worse_on_test(f)
        // Its errors say little as long as the amplifier does not follow.
        && f.remainder.slew_limit.is_none()
    {
        let command = format!("hystctl compensate --model {} reference.csv -o drive.csv", quoted(extended));
        advise("The drive that makes the actuator follow a reference:", &[command]);
    }
    all
}

/// Names of the training files, as the command line takes them.
pub fn files(train: &Record) -> String {
    train.sources().iter().map(|s| quoted(&s.name)).collect::<Vec<_>>().join(" ")
}

/// The option that names the test file, behind a space.
fn test_option(c: &Contents<'_>) -> String {
    c.test.map_or_else(String::new, |t| format!(" --test {}", quoted(&t.name())))
}

/// A word of the command line.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/+:=,@".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', r"'\''")) }
}

/// Further words of the command line, each behind a space.
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
    fn words_of_a_command_stay_words() {
        assert_eq!(quoted("train.csv"), "train.csv");
        assert_eq!(quoted("my record;rm.csv"), "'my record;rm.csv'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
        assert_eq!(further(&["--map".into(), "u (V)=voltage_v".into()]), " --map 'u (V)=voltage_v'");
        assert_eq!(further(&[]), "");
    }
}
