//! What a person sees of a run while it goes on: a picture of the last seconds in the terminal, or a bar.

mod picture;
mod seconds;

use std::io::{IsTerminal, Stderr, stderr, stdin, stdout};
use std::time::{Duration, Instant};

use hyst_hw::Sample;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyModifiers};
use ratatui::crossterm::terminal;
use ratatui::layout::Size;
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Widget};
use ratatui::{Terminal, TerminalOptions, Viewport};

use crate::progress::Progress;
use seconds::Seconds;

/// How often the picture is drawn anew.
const EVERY: Duration = Duration::from_millis(100);
/// Lines of the terminal that it takes.
const LINES: u16 = 16;
/// Columns and lines that a terminal has at least where there is a picture: on one of no size nothing can ever be written above it.
const LEAST: Size = Size::new(20, 8);

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
    /// What there was no room for.
    untold: Vec<String>,
}

/// Whether a picture, and a line above it, has room.
fn roomy(size: Size) -> bool {
    size.width >= LEAST.width && size.height >= LEAST.height
}

impl View {
    /// Of a run of so many samples; `plain` asks for a bar.
    pub(super) fn new(total: usize, unit: &'static str, plain: bool) -> Self {
        let options = TerminalOptions { viewport: Viewport::Inline(LINES) };
        // Where the cursor is, is asked on stdout and answered on stdin: neither may be anything else.
        let asked = stdout().is_terminal() && stdin().is_terminal();
        let able = std::env::var_os("TERM").is_none_or(|name| name != "dumb");
        let able = able && terminal::size().is_ok_and(|(width, height)| roomy(Size::new(width, height)));
        let terminal = (stderr().is_terminal() && asked && able && !plain)
            // A terminal that does not say where its cursor is has no picture.
            .then(|| Terminal::with_options(CrosstermBackend::new(stderr()), options).ok())
            .flatten();
        match terminal {
            Some(terminal) => {
                let seconds = Seconds::default();
                Self::Picture(Box::new(Picture { terminal, seconds, unit, drawn: None, untold: Vec::new() }))
            }
            None => Self::Bar(Progress::steady("playing", total)),
        }
    }

    /// Whether Ctrl-C was typed while the terminal was asked where its cursor is: it is a key then, and no signal.
    pub(super) fn interrupted() -> bool {
        if !(stdout().is_terminal() && stdin().is_terminal()) {
            return false;
        }
        let mut interrupted = false;
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let Ok(event) = event::read() else { break };
            interrupted |= matches!(event, Event::Key(KeyEvent { code: KeyCode::Char('c'), modifiers, .. }) if modifiers.contains(KeyModifiers::CONTROL));
        }
        interrupted
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
        let Some(size) = self.terminal.size().ok().filter(|size| roomy(*size)) else {
            // Made small meanwhile.
            self.untold.push(text.to_owned());
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
        // What is said next begins where the picture was.
        let _ = self.terminal.set_cursor_position(place);
        let _ = self.terminal.show_cursor();
        self.untold.iter().for_each(|text| crate::output::say(text));
    }
}
