//! How a command ends: its exit code, and what it says on stderr.

use std::error::Error;
use std::fmt;
use std::io::{self, Write};

use hyst_core::BlockError;
use hyst_hw::{ConfigError, PlantError};
use hyst_ident::atomic_file::AtomicFileError;
use hyst_ident::compensate::CompensateError;
use hyst_ident::excite::ExciteError;
use hyst_ident::fit::FitError;
use hyst_ident::linear::LinearError;
use hyst_ident::metrics::MetricsError;
use hyst_ident::model::ModelError;
use hyst_ident::record::{MapError, RecordError, WriteError};

use crate::log::LogError;

/// What the exit code tells a script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// The command did what it was asked for.
    Done = 0,
    /// It could not, though nothing was wrong with what it was given.
    Failed = 1,
    /// The arguments or an input file are wrong.
    BadInput = 2,
    /// The device is lost, or measured data are at risk.
    DeviceLost = 3,
}

/// Why a command ended before its time.
#[derive(Debug)]
pub(crate) struct CommandError {
    exit: Exit,
    cause: anyhow::Error,
}

/// What a command returns.
pub(crate) type CommandResult<T = ()> = Result<T, CommandError>;

impl CommandError {
    /// An error with its causes.
    pub(crate) fn new(exit: Exit, cause: impl Into<anyhow::Error>) -> Self {
        Self { exit, cause: cause.into() }
    }

    /// The arguments do not make sense.
    pub(crate) fn bad_input(message: impl fmt::Display) -> Self {
        Self { exit: Exit::BadInput, cause: anyhow::anyhow!("{message}") }
    }

    /// Something failed that is nobody's fault.
    pub(crate) fn failed(message: impl fmt::Display) -> Self {
        Self { exit: Exit::Failed, cause: anyhow::anyhow!("{message}") }
    }

    /// The exit code.
    pub(crate) fn exit(&self) -> Exit {
        self.exit
    }

    /// Says on stderr what happened, and returns the exit code.
    pub(crate) fn print(&self) -> Exit {
        // Where stderr is closed there is nobody to tell.
        let _ = writeln!(io::stderr().lock(), "error: {}", self.text());
        self.exit
    }

    /// The message and below it every cause that it does not contain already.
    pub(crate) fn text(&self) -> String {
        let mut text = self.cause.to_string();
        for cause in self.cause.chain().skip(1) {
            let cause = cause.to_string();
            if !text.contains(&cause) {
                text.push_str("\n  because: ");
                text.push_str(&cause);
            }
        }
        text
    }
}

/// Which exit code an error of the libraries has.
pub(crate) trait Classified: Error + Send + Sync + 'static {
    /// The exit code.
    fn exit(&self) -> Exit;
}

impl<E: Classified> From<E> for CommandError {
    fn from(error: E) -> Self {
        Self { exit: error.exit(), cause: error.into() }
    }
}

macro_rules! always {
    ($exit:ident: $($error:ty),+) => {
        $(impl Classified for $error {
            fn exit(&self) -> Exit {
                Exit::$exit
            }
        })+
    };
}

always!(BadInput: RecordError, MapError, ModelError, ExciteError, ConfigError);
always!(Failed: AtomicFileError, WriteError, BlockError, io::Error);
always!(DeviceLost: LogError);

impl Classified for FitError {
    fn exit(&self) -> Exit {
        match self {
            Self::Stopped { .. }
            | Self::Unsolvable { .. }
            | Self::Compare { source: MetricsError::NotFinite { .. }, .. } => Exit::Failed,
            _ => Exit::BadInput,
        }
    }
}

impl Classified for LinearError {
    fn exit(&self) -> Exit {
        match self {
            Self::Unfit { .. } => Exit::Failed,
            _ => Exit::BadInput,
        }
    }
}

impl Classified for PlantError {
    fn exit(&self) -> Exit {
        match self {
            Self::Running | Self::NotRunning | Self::SensorRange { .. } => Exit::DeviceLost,
            _ => Exit::BadInput,
        }
    }
}

impl Classified for CompensateError {
    fn exit(&self) -> Exit {
        match self {
            Self::Inverse(hyst_core::Error::NotInvertible(_)) => Exit::Failed,
            _ => Exit::BadInput,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("the outer thing: {inner}")]
    struct Told {
        #[source]
        inner: io::Error,
    }

    #[derive(Debug, thiserror::Error)]
    #[error("the outer thing")]
    struct Untold(#[source] io::Error);

    #[test]
    fn causes_are_told_once() {
        let told = CommandError::new(Exit::Failed, Told { inner: io::Error::other("disk full") });
        assert_eq!(told.text(), "the outer thing: disk full");
        let untold = CommandError::new(Exit::DeviceLost, Untold(io::Error::other("disk full")));
        assert_eq!(untold.text(), "the outer thing\n  because: disk full");
        assert_eq!(untold.print(), Exit::DeviceLost);
    }

    #[test]
    fn what_the_user_can_mend_is_bad_input() {
        assert_eq!(CommandError::from(RecordError::Nothing).exit, Exit::BadInput);
        assert_eq!(CommandError::from(FitError::Unsolvable { record: "a.csv".into() }).exit, Exit::Failed);
        assert_eq!(CommandError::from(CompensateError::Inverse(hyst_core::Error::NonFinite("x"))).exit, Exit::BadInput);
    }
}
