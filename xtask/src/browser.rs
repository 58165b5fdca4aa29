//! The browser in which a test opens the report of a diagnosis.

use crate::command::{Outcome, install, which};

/// Debian's package, and its program.
const CHROMIUM: &str = "chromium";
/// The same under other names; the test knows them as well.
const OTHERS: [&str; 2] = ["chromium-browser", "google-chrome"];

/// Whether there is one; it is installed if that can be done without asking.
pub(crate) fn check() -> Outcome {
    if which(CHROMIUM).is_some() || OTHERS.iter().any(|name| which(name).is_some()) || install(&[CHROMIUM]) {
        return Outcome::Passed;
    }
    Outcome::Skipped(format!("no browser, so no report is opened in one (Debian: `apt-get install {CHROMIUM}`)"))
}
