//! The browser for the test of the diagnosis report.

use crate::command::{Outcome, install, which};

/// Name of Debian's package and of its program.
const CHROMIUM: &str = "chromium";
/// Other names of the program, which the test also accepts.
const OTHERS: [&str; 2] = ["chromium-browser", "google-chrome"];

/// Passes if there is a browser; installs one as root.
pub(crate) fn check() -> Outcome {
    if which(CHROMIUM).is_some() || OTHERS.iter().any(|name| which(name).is_some()) || install(&[CHROMIUM]) {
        return Outcome::Passed;
    }
    Outcome::Skipped(format!("no browser to open the report in (Debian: `apt-get install {CHROMIUM}`)"))
}
