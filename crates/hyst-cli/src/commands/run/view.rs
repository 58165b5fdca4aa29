//! View of a run in the terminal: a plot of the last seconds, or a progress bar.

mod picture;
mod seconds;

use std::io::{IsTerminal, Stderr, stderr, stdin, stdout};
use std::time::{Duration, Instant};

use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyModifiers};
use ratatui::crossterm::terminal;
use ratatui::layout::Size;
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Widget};
use ratatui::{Terminal, TerminalOptions, Viewport};

use super::values::Values;
use crate::progress::Progress;
use seconds::Seconds;

/// Interval between drawings of the plot.
const DRAW_INTERVAL: Duration = Duration::from_millis(100);
/// Height of the plot \[lines\].
const LINES: u16 = 16;
/// Minimum size of a terminal with a plot.
/// ratatui cannot write above a plot in a terminal without a size.
const MIN_SIZE: Size = Size::new(20, 8);

/// The view of a run.
pub(super) struct View {
    shown: Shown,
    /// Whether Ctrl-C was typed during a query of the cursor position.
    /// It is read as a key then and raises no signal.
    interrupted: bool,
}

/// Kind of view.
enum Shown {
    /// A progress bar; nothing if stderr is not a terminal.
    Bar(Progress),
    Picture(Box<Picture>),
}

/// A plot in the terminal.
struct Picture {
    size: Option<Size>,
    terminal: Terminal<CrosstermBackend<Stderr>>,
    seconds: Seconds,
    /// Symbol of the output unit.
    unit: &'static str,
    drawn: Option<Instant>,
    /// Lines that had no room above the plot; printed at the end.
    pending: Vec<String>,
}

/// Whether a terminal has room for a plot and a line above it.
fn has_room(size: Size) -> bool {
    size.width >= MIN_SIZE.width && size.height >= MIN_SIZE.height
}

impl View {
    /// Creates the view of a run with `total` samples; `plain` selects the progress bar.
    pub(super) fn new(total: usize, unit: &'static str, plain: bool) -> Self {
        let options = TerminalOptions { viewport: Viewport::Inline(LINES) };
        // The query of the cursor position goes to stdout and its answer comes on stdin, so both must be terminals.
        let can_query = stdout().is_terminal() && stdin().is_terminal();
        let able = std::env::var_os("TERM").is_none_or(|name| name != "dumb");
        let able = able && terminal::size().is_ok_and(|(width, height)| has_room(Size::new(width, height)));
        let wanted = stderr().is_terminal() && can_query && able && !plain;
        // A terminal that does not answer the query has no plot.
        let terminal = wanted.then(|| Terminal::with_options(CrosstermBackend::new(stderr()), options).ok()).flatten();
        let shown = match terminal {
            Some(terminal) => {
                let (seconds, size) = (Seconds::default(), terminal.size().ok());
                Shown::Picture(Box::new(Picture { size, terminal, seconds, unit, drawn: None, pending: Vec::new() }))
            }
            None => Shown::Bar(Progress::steady("playing", total)),
        };
        Self { shown, interrupted: wanted && typed_interrupt() }
    }

    /// Whether Ctrl-C was typed as a key, without a signal.
    pub(super) fn interrupted(&self) -> bool {
        self.interrupted
    }

    /// Adds the values of a sample.
    pub(super) fn add(&mut self, values: Values) {
        if let Shown::Picture(picture) = &mut self.shown {
            picture.seconds.add(values);
        }
    }

    /// Shows the progress of the run.
    pub(super) fn show(&mut self, done: usize, total: usize) {
        match &mut self.shown {
            Shown::Bar(bar) => bar.at(done),
            Shown::Picture(picture) => {
                picture.draw(done, total);
                // A change of size has queried the cursor position again.
                let size = picture.terminal.size().ok();
                if size != picture.size {
                    picture.size = size;
                    self.interrupted |= typed_interrupt();
                }
            }
        }
    }

    /// Prints a line above the view.
    pub(super) fn print_above(&mut self, text: &str) {
        match &mut self.shown {
            Shown::Bar(bar) => bar.print_above(text),
            Shown::Picture(picture) => {
                picture.print_above(text);
                self.interrupted |= typed_interrupt();
            }
        }
    }
}

/// Whether Ctrl-C is among the keys that were read with the answer to a query of the cursor position.
fn typed_interrupt() -> bool {
    let mut interrupted = false;
    while event::poll(Duration::ZERO).unwrap_or(false) {
        let Ok(event) = event::read() else { break };
        let Event::Key(KeyEvent { code: KeyCode::Char('c'), modifiers, .. }) = event else { continue };
        interrupted |= modifiers.contains(KeyModifiers::CONTROL);
    }
    interrupted
}

impl Picture {
    fn draw(&mut self, done: usize, total: usize) {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < DRAW_INTERVAL) {
            return;
        }
        self.drawn = Some(Instant::now());
        let share = done as f64 / total.max(1) as f64;
        // A failure to draw must not stop the run.
        let _ = self.terminal.draw(|frame| picture::draw(frame, &self.seconds, self.unit, share));
    }

    /// Prints a line above the plot.
    fn print_above(&mut self, text: &str) {
        // Without this the line would be written for the size of the last drawing.
        let _ = self.terminal.autoresize();
        let Some(size) = self.terminal.size().ok().filter(|size| has_room(*size)) else {
            // The terminal has become too small.
            self.pending.push(text.to_owned());
            return;
        };
        let height = (text.chars().count() as u16).div_ceil(size.width).max(1);
        let line = Paragraph::new(Line::from(text.to_owned())).wrap(ratatui::widgets::Wrap { trim: true });
        let _ = self.terminal.insert_before(height, |buffer| line.render(buffer.area, buffer));
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        let place = self.terminal.get_frame().area().as_position();
        let _ = self.terminal.clear();
        // Later output starts where the plot was.
        let _ = self.terminal.set_cursor_position(place);
        let _ = self.terminal.show_cursor();
        self.pending.iter().for_each(|text| crate::output::say(text));
    }
}
