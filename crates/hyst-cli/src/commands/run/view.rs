//! What a person sees of a run while it goes on: a picture of the last seconds in the terminal, or a bar.

mod picture;
mod seconds;

use std::io::{IsTerminal, Stderr, stderr, stdin, stdout};
use std::time::{Duration, Instant};

use hyst_hw::Sample;
use ratatui::backend::CrosstermBackend;
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Widget};
use ratatui::{Terminal, TerminalOptions, Viewport};

use crate::progress::Progress;
use seconds::Seconds;

/// How often the picture is drawn anew.
const EVERY: Duration = Duration::from_millis(100);
/// Lines of the terminal that it takes.
const LINES: u16 = 16;

/// One instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) sample: Sample,
    /// Wanted output.
    pub(super) wanted: Option<f64>,
    /// What the model expects.
    pub(super) predicted: Option<f64>,
    /// \[N\]
    pub(super) force: Option<f64>,
}

/// What is shown where.
pub(super) enum View {
    /// A bar, or nothing where stderr is no terminal.
    Bar(Progress),
    Picture(Box<Picture>),
}

/// A picture in the terminal.
pub(super) struct Picture {
    terminal: Terminal<CrosstermBackend<Stderr>>,
    seconds: Seconds,
    /// Symbol of the output's unit.
    unit: &'static str,
    drawn: Option<Instant>,
}

impl View {
    /// Of a run of so many samples; `plain` asks for a bar.
    pub(super) fn new(total: usize, unit: &'static str, plain: bool) -> Self {
        let options = TerminalOptions { viewport: Viewport::Inline(LINES) };
        // Where the cursor is, is asked on stdout and answered on stdin: neither may be anything else.
        let asked = stdout().is_terminal() && stdin().is_terminal();
        let terminal = (stderr().is_terminal() && asked && !plain)
            // A terminal that does not say where its cursor is has no picture.
            .then(|| Terminal::with_options(CrosstermBackend::new(stderr()), options).ok())
            .flatten();
        match terminal {
            Some(terminal) => {
                Self::Picture(Box::new(Picture { terminal, seconds: Seconds::default(), unit, drawn: None }))
            }
            None => Self::Bar(Progress::bar("playing", total)),
        }
    }

    /// Takes a sample.
    pub(super) fn add(&mut self, seen: Seen) {
        if let Self::Picture(picture) = self {
            picture.seconds.add(seen);
        }
    }

    /// Shows how far the run is.
    pub(super) fn show(&mut self, done: usize, total: usize) {
        match self {
            Self::Bar(bar) => bar.at(done),
            Self::Picture(picture) => picture.draw(done, total),
        }
    }

    /// Says something that has happened.
    pub(super) fn tell(&mut self, text: &str) {
        match self {
            Self::Bar(bar) => bar.tell(text),
            Self::Picture(picture) => picture.tell(text),
        }
    }
}

impl Picture {
    fn draw(&mut self, done: usize, total: usize) {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < EVERY) {
            return;
        }
        self.drawn = Some(Instant::now());
        let share = done as f64 / total.max(1) as f64;
        // A picture that cannot be drawn is no reason to stop an actuator.
        let _ = self.terminal.draw(|frame| picture::draw(frame, &self.seconds, self.unit, share));
    }

    /// Above the picture, where it stays.
    fn tell(&mut self, text: &str) {
        let width = self.terminal.size().map_or(80, |size| size.width.max(1));
        let height = (text.chars().count() as u16).div_ceil(width).max(1);
        let line = Paragraph::new(Line::from(text.to_owned())).wrap(ratatui::widgets::Wrap { trim: true });
        let _ = self.terminal.insert_before(height, |buffer| line.render(buffer.area, buffer));
    }
}

impl Drop for Picture {
    fn drop(&mut self) {
        let place = self.terminal.get_frame().area().as_position();
        let _ = self.terminal.clear();
        // What is said next begins where the picture was.
        let _ = self.terminal.set_cursor_position(place);
        let _ = self.terminal.show_cursor();
    }
}
