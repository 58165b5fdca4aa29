//! Summary of a report: the verdict, and the errors of the given and the extended model.

use hyst_ident::diagnose::{FoundErrors, OnRecords};
use hyst_ident::simulate::Zero;

use super::html::{Page, Table};
use super::{Contents, words};
use crate::text::{percent, short};

/// Writes the summary.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    let (f, unit) = (&c.diagnosis.findings, c.unit());
    page.paragraph("verdict", &words::verdict(f));
    let changed = !f.effects.is_empty();
    let shown = |errors: &OnRecords| errors.test.or(errors.train);
    if let (Some(before), Some(after)) = (shown(&f.before), shown(&f.after)) {
        let record =
            if f.after.test.is_some() { "the test record, which was never fitted," } else { "the training record" };
        let figure = |e: FoundErrors| format!("{} {unit} ({} of span)", short(e.rmse), percent(e.nrmse_percent));
        if !changed {
            page.paragraph("", &format!("On {record} the RMS error is {}", figure(after)));
        } else {
            page.paragraph(
                "",
                &format!("On {record} the RMS error changes from {} to {}", figure(before), figure(after)),
            );
        }
    }
    if words::worse_on_test(f) {
        page.paragraph(
            "note",
            "On the test record the extended model has a larger error: do not use it. The training record may not be sufficient \
             to distinguish effects; record the drive of hystctl excite identification",
        );
    }
    let all = [f.before.train, f.after.train, f.before.test, f.after.test];
    // Without start-up rows both columns would be equal.
    let start_up = all.iter().flatten().any(|e| e.rmse_all_rows != e.rmse);
    let mut table = Table::new("Errors before and after")
        .words("record")
        .words("model")
        .numbers(&format!("RMSE [{unit}]"))
        .numbers("of span")
        .numbers(&format!("maximum [{unit}]"));
    if start_up {
        table = table.numbers(&format!("RMSE, all rows [{unit}]"));
    }
    for (record, before, after) in [("training", f.before.train, f.after.train), ("test", f.before.test, f.after.test)]
    {
        for (model, errors) in [("as given", before), ("extended", after)] {
            if let Some(e) = errors {
                let mut cells = vec![record.to_owned(), model.to_owned()];
                cells.extend([short(e.rmse), percent(e.nrmse_percent), short(e.max_abs)]);
                cells.extend(start_up.then(|| short(e.rmse_all_rows)));
                match model {
                    "extended" if !changed => {}
                    "extended" => table.named_row(&cells),
                    _ => table.row(&cells),
                }
            }
        }
    }
    page.table(&table);
    if let Some(plays) = words::plays_placed_anew(f) {
        page.paragraph("soft", &plays);
    }
    let zero = match f.zero {
        Zero::None => "the sensor zero of the model is used for all records",
        Zero::PerRecord => "one sensor zero per file is estimated from its measured output",
    };
    let start_up = if start_up { "; start-up rows of the models count in the last column only" } else { "" };
    let floor = short(f.noise_floor);
    page.paragraph(
        "soft",
        &format!("Noise floor {floor} {unit}; {zero}; nothing is fitted to the test record{start_up}"),
    );
    page.raw("<noscript><p class=\"note\">The plots need JavaScript; text and tables do not.</p></noscript>");
}
