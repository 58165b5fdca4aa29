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

/// What is shown.
pub(super) struct View {
    shown: Shown,
    /// Whether Ctrl-C was typed while the terminal was asked where its cursor is: it is a key then, and no signal.
    interrupted: bool,
}

/// What is shown where.
enum Shown {
    /// A bar, or nothing where stderr is no terminal.
    Bar(Progress),
    Picture(Box<Picture>),
}

/// A picture in the terminal.
struct Picture {
    size: Option<Size>,
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
        let wanted = stderr().is_terminal() && asked && able && !plain;
        // A terminal that does not say where its cursor is has no picture.
        let terminal = wanted.then(|| Terminal::with_options(CrosstermBackend::new(stderr()), options).ok()).flatten();
        let shown = match terminal {
            Some(terminal) => {
                let (seconds, size) = (Seconds::default(), terminal.size().ok());
                Shown::Picture(Box::new(Picture { size, terminal, seconds, unit, drawn: None, untold: Vec::new() }))
            }
            None => Shown::Bar(Progress::steady("playing", total)),
        };
        Self { shown, interrupted: wanted && typed_interrupt() }
    }

    /// Whether Ctrl-C was typed where it is no signal.
    pub(super) fn interrupted(&self) -> bool {
        self.interrupted
    }

    /// Takes a sample.
    pub(super) fn add(&mut self, seen: Seen) {
        if let Shown::Picture(picture) = &mut self.shown {
            picture.seconds.add(seen);
        }
    }

    /// Shows how far the run is.
    pub(super) fn show(&mut self, done: usize, total: usize) {
        match &mut self.shown {
            Shown::Bar(bar) => bar.at(done),
            Shown::Picture(picture) => {
                picture.draw(done, total);
                // Of another size, the terminal was asked anew.
                let size = picture.terminal.size().ok();
                if size != picture.size {
                    picture.size = size;
                    self.interrupted |= typed_interrupt();
                }
            }
        }
    }

    /// Says something that has happened.
    pub(super) fn tell(&mut self, text: &str) {
        match &mut self.shown {
            Shown::Bar(bar) => bar.tell(text),
            Shown::Picture(picture) => {
                picture.tell(text);
                self.interrupted |= typed_interrupt();
            }
        }
    }
}

/// Whether Ctrl-C is among the keys that were read along with the terminal's answer.
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
        // What is written above goes by the size that was known at the last drawing.
        let _ = self.terminal.autoresize();
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
