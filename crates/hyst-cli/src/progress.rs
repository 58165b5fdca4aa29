//! What a person sees while a command works: on stderr, and only where that is a terminal.

use std::io::{IsTerminal, stderr};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A line that says what is being done. It vanishes when dropped.
#[derive(Debug)]
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// A spinner beside `message`, for work of unknown length.
    pub(crate) fn spinner(message: &str) -> Self {
        let bar = Self::on_terminal(ProgressBar::new_spinner(), "{spinner} {msg} [{elapsed}]");
        bar.0.set_message(message.to_owned());
        if !bar.0.is_hidden() {
            bar.0.enable_steady_tick(Duration::from_millis(120));
        }
        bar
    }

    /// A bar of `total` steps.
    pub(crate) fn bar(message: &str, total: usize) -> Self {
        let bar = Self::on_terminal(ProgressBar::new(total as u64), "{msg} {wide_bar} {percent} % [{eta} left]");
        bar.0.set_message(message.to_owned());
        bar
    }

    /// A bar of `total` steps of work that keeps its own pace.
    pub(crate) fn steady(message: &str, total: usize) -> Self {
        let bar = Self::on_terminal(ProgressBar::new(total as u64), "{msg} {wide_bar} {percent} % [{elapsed}]");
        bar.0.set_message(message.to_owned());
        bar
    }

    fn on_terminal(bar: ProgressBar, template: &str) -> Self {
        let target = if stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        bar.set_draw_target(target);
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner());
        Self(bar.with_style(style))
    }

    /// Says what is being done now.
    pub(crate) fn say(&self, message: &str) {
        self.0.set_message(message.to_owned());
    }

    /// Prints a line above it.
    pub(crate) fn tell(&self, line: &str) {
        self.0.suspend(|| crate::output::say(line));
    }

    /// Moves the bar.
    pub(crate) fn at(&self, done: usize) {
        self.0.set_position(done as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
