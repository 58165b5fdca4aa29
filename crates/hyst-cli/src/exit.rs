//! Exit codes and errors of commands.

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

/// Exit code of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// The command succeeded.
    Done = 0,
    /// The command failed with valid arguments and inputs.
    Failed = 1,
    /// The arguments or an input file are wrong.
    BadInput = 2,
    /// The device is lost, or measured data are at risk.
    DeviceLost = 3,
}

/// Error of a command, with its exit code.
#[derive(Debug)]
pub(crate) struct CommandError {
    exit: Exit,
    cause: anyhow::Error,
}

/// Result of a command.
pub(crate) type CommandResult<T = ()> = Result<T, CommandError>;

impl CommandError {
    /// Creates an error from its cause.
    pub(crate) fn new(exit: Exit, cause: impl Into<anyhow::Error>) -> Self {
        Self { exit, cause: cause.into() }
    }

    /// Creates an error of the arguments or inputs.
    pub(crate) fn bad_input(message: impl fmt::Display) -> Self {
        Self { exit: Exit::BadInput, cause: anyhow::anyhow!("{message}") }
    }

    /// Creates an error of a command with valid arguments and inputs.
    pub(crate) fn failed(message: impl fmt::Display) -> Self {
        Self { exit: Exit::Failed, cause: anyhow::anyhow!("{message}") }
    }

    /// Returns the exit code.
    pub(crate) fn exit(&self) -> Exit {
        self.exit
    }

    /// Prints the error to stderr and returns the exit code.
    pub(crate) fn print(&self) -> Exit {
        // A closed stderr is not an error.
        let _ = writeln!(io::stderr().lock(), "error: {}", self.text());
        self.exit
    }

    /// Returns the message, followed by each cause that it does not contain.
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

/// An error of the libraries with an exit code.
pub(crate) trait Classified: Error + Send + Sync + 'static {
    /// Returns the exit code.
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
    struct WithCause {
        #[source]
        inner: io::Error,
    }

    #[derive(Debug, thiserror::Error)]
    #[error("the outer thing")]
    struct WithoutCause(#[source] io::Error);

    #[test]
    fn each_cause_is_printed_once() {
        let with_cause = CommandError::new(Exit::Failed, WithCause { inner: io::Error::other("disk full") });
        assert_eq!(with_cause.text(), "the outer thing: disk full");
        let without_cause = CommandError::new(Exit::DeviceLost, WithoutCause(io::Error::other("disk full")));
        assert_eq!(without_cause.text(), "the outer thing\n  because: disk full");
        assert_eq!(without_cause.print(), Exit::DeviceLost);
    }

    #[test]
    fn errors_that_the_user_can_fix_are_bad_input() {
        assert_eq!(CommandError::from(RecordError::Nothing).exit, Exit::BadInput);
        assert_eq!(CommandError::from(FitError::Unsolvable { record: "a.csv".into() }).exit, Exit::Failed);
        assert_eq!(CommandError::from(CompensateError::Inverse(hyst_core::Error::NonFinite("x"))).exit, Exit::BadInput);
    }
}
