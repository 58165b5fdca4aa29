//! Drawing area of pictures: SVG or PNG, selected by the ending of the file name.

use std::io;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters_backend::{BackendColor, BackendStyle, BackendTextStyle, DrawingErrorKind};

use crate::exit::{CommandError, CommandResult};
use crate::output::Target;

/// Result of drawing.
pub(crate) type Drawn = Result<(), Box<dyn std::error::Error>>;
/// Area of a picture or of one of its panels.
pub(crate) type Area<'a> = DrawingArea<Canvas<'a>, Shift>;

/// The format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Svg,
    Png,
}

impl Format {
    /// Returns the format of a picture that goes to `target`; SVG on stdout.
    ///
    /// # Errors
    /// When the file name has another ending.
    pub(crate) fn of(target: &Target) -> CommandResult<Self> {
        let ending = target.file().map(|path| path.extension().map(|ending| ending.to_ascii_lowercase()));
        match ending.as_ref().map(|ending| ending.as_deref().and_then(|ending| ending.to_str())) {
            None | Some(Some("svg")) => Ok(Self::Svg),
            Some(Some("png")) => Ok(Self::Png),
            Some(_) => Err(CommandError::bad_input(format!(
                "{target}: pictures are written as SVG or PNG; give a name that ends in .svg or .png"
            ))),
        }
    }

    /// Returns the file content of the picture that `draw` makes on an area of `size` \[pixels\].
    ///
    /// # Errors
    /// When it cannot be drawn.
    pub(crate) fn draw(self, size: (u32, u32), draw: impl FnOnce(&Area<'_>) -> Drawn) -> CommandResult<Vec<u8>> {
        match self {
            Self::Svg => {
                let mut svg = String::new();
                on(Canvas::Svg(SVGBackend::with_string(&mut svg, size)), draw)?;
                Ok(svg.into_bytes())
            }
            Self::Png => {
                let mut pixels = vec![0; 3 * size.0 as usize * size.1 as usize];
                on(Canvas::Png(BitMapBackend::with_buffer(&mut pixels, size)), draw)?;
                encoded(&pixels, size).map_err(|e| failed(&e))
            }
        }
    }
}

fn on(canvas: Canvas<'_>, draw: impl FnOnce(&Area<'_>) -> Drawn) -> CommandResult {
    register_font();
    let root = canvas.into_drawing_area();
    let all = || -> Drawn {
        root.fill(&WHITE)?;
        draw(&root)?;
        Ok(root.present()?)
    };
    all().map_err(|e| failed(e.as_ref()))
}

fn failed(error: &dyn std::error::Error) -> CommandError {
    CommandError::failed(format!("the picture could not be drawn: {error}"))
}

/// Registers a built-in font, so that a picture is the same on all systems.
fn register_font() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Fails only for a damaged font; drawing then reports the error.
        let _ = plotters::style::register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular());
    });
}

fn encoded(pixels: &[u8], (width, height): (u32, u32)) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

/// A drawing backend: SVG or PNG.
pub(crate) enum Canvas<'a> {
    Svg(SVGBackend<'a>),
    Png(BitMapBackend<'a>),
}

type Outcome<T = ()> = Result<T, DrawingErrorKind<io::Error>>;

/// Converts the error of a backend.
fn converted<T, E: std::error::Error + Send + Sync + 'static>(outcome: Result<T, DrawingErrorKind<E>>) -> Outcome<T> {
    outcome.map_err(|error| match error {
        DrawingErrorKind::DrawingError(error) => DrawingErrorKind::DrawingError(io::Error::other(error.to_string())),
        DrawingErrorKind::FontError(error) => DrawingErrorKind::FontError(error),
    })
}

/// Makes the same call on either backend.
macro_rules! either {
    ($canvas:expr, $call:ident($($argument:expr),*)) => {
        match $canvas {
            Canvas::Svg(svg) => converted(svg.$call($($argument),*)),
            Canvas::Png(png) => converted(png.$call($($argument),*)),
        }
    };
}

type Point = (i32, i32);

impl DrawingBackend for Canvas<'_> {
    type ErrorType = io::Error;

    fn get_size(&self) -> (u32, u32) {
        match self {
            Self::Svg(svg) => svg.get_size(),
            Self::Png(png) => png.get_size(),
        }
    }

    fn ensure_prepared(&mut self) -> Outcome {
        either!(self, ensure_prepared())
    }

    fn present(&mut self) -> Outcome {
        either!(self, present())
    }

    fn draw_pixel(&mut self, point: Point, colour: BackendColor) -> Outcome {
        either!(self, draw_pixel(point, colour))
    }

    fn draw_line<S: BackendStyle>(&mut self, from: Point, to: Point, style: &S) -> Outcome {
        either!(self, draw_line(from, to, style))
    }

    fn draw_rect<S: BackendStyle>(&mut self, from: Point, to: Point, style: &S, fill: bool) -> Outcome {
        either!(self, draw_rect(from, to, style, fill))
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = Point>>(&mut self, path: I, style: &S) -> Outcome {
        either!(self, draw_path(path, style))
    }

    fn draw_circle<S: BackendStyle>(&mut self, centre: Point, radius: u32, style: &S, fill: bool) -> Outcome {
        either!(self, draw_circle(centre, radius, style, fill))
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = Point>>(&mut self, corners: I, style: &S) -> Outcome {
        either!(self, fill_polygon(corners, style))
    }

    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, at: Point) -> Outcome {
        either!(self, draw_text(text, style, at))
    }

    fn estimate_text_size<T: BackendTextStyle>(&self, text: &str, style: &T) -> Outcome<(u32, u32)> {
        either!(self, estimate_text_size(text, style))
    }
}
