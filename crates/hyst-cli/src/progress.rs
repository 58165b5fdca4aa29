//! Progress of a command: a line on stderr, only if stderr is a terminal.

use std::io::{IsTerminal, stderr};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress line. It is removed when dropped.
#[derive(Debug)]
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// Creates a spinner with a message, for work of unknown length.
    pub(crate) fn spinner(message: &str) -> Self {
        let bar = Self::on_terminal(ProgressBar::new_spinner(), "{spinner} {msg} [{elapsed}]");
        bar.0.set_message(message.to_owned());
        if !bar.0.is_hidden() {
            bar.0.enable_steady_tick(Duration::from_millis(120));
        }
        bar
    }

    /// Creates a bar of `total` steps with the estimated remaining time.
    pub(crate) fn bar(message: &str, total: usize) -> Self {
        let bar = Self::on_terminal(ProgressBar::new(total as u64), "{msg} {wide_bar} {percent} % [{eta} left]");
        bar.0.set_message(message.to_owned());
        bar
    }

    /// Creates a bar of `total` steps with the elapsed time, for work with a fixed duration.
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

    /// Replaces the message.
    pub(crate) fn set_message(&self, message: &str) {
        self.0.set_message(message.to_owned());
    }

    /// Prints a line above the progress line.
    pub(crate) fn print_above(&self, line: &str) {
        self.0.suspend(|| crate::output::say(line));
    }

    /// Moves the bar to `done` steps.
    pub(crate) fn at(&self, done: usize) {
        self.0.set_position(done as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
