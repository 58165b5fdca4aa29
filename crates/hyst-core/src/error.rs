//! What can be wrong with parameters.

use core::fmt;

/// Why coefficients or an inverse could not be built. Each variant names the parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The parameter is NaN or infinite.
    NonFinite(&'static str),
    /// The parameter is outside the range in which the stage is defined.
    OutOfRange {
        /// The parameter.
        name: &'static str,
        /// The range, in words.
        must: &'static str,
    },
    /// More elements than the stage's type has room for.
    Capacity {
        /// What there are too many of.
        name: &'static str,
        /// How many would be needed.
        needed: usize,
        /// How many the type holds.
        holds: usize,
    },
    /// A node of a table over (α, β) breaks a rule.
    Node {
        /// The table.
        name: &'static str,
        /// Place of the node along α.
        alpha: usize,
        /// Place of the node along β.
        beta: usize,
        /// The rule, in words.
        must: &'static str,
    },
    /// Two lists that belong together differ in length.
    Lengths(&'static str),
    /// The operator has no inverse.
    NotInvertible(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NonFinite(name) => write!(f, "{name} is not a finite number"),
            Self::OutOfRange { name, must } => write!(f, "{name} must be {must}"),
            Self::Capacity { name, needed, holds } => {
                write!(f, "{name}: {needed} needed, but this type holds {holds}")
            }
            Self::Node { name, alpha, beta, must } => write!(f, "{name}: node (α {alpha}, β {beta}) must {must}"),
            Self::Lengths(name) => write!(f, "{name} differ in length"),
            Self::NotInvertible(why) => write!(f, "no inverse: {why}"),
        }
    }
}

impl core::error::Error for Error {}

impl Error {
    /// The error of a part in the words of the model that has the part: every pair is the part's own word and what the
    /// model's file calls it, `("preisach.low", "dpm.preisach.low")`. What is in no pair stays.
    ///
    /// For a part with many words: comparing them costs flash. Of few, a `match` where the part is built costs none, because the compiler
    /// knows there which errors can come.
    #[cold]
    pub(crate) fn in_words(self, words: &[(&'static str, &'static str)]) -> Self {
        let say = |own| words.iter().find(|(part, _)| *part == own).map_or(own, |(_, whole)| *whole);
        match self {
            Self::NonFinite(name) => Self::NonFinite(say(name)),
            Self::OutOfRange { name, must } => Self::OutOfRange { name: say(name), must: say(must) },
            Self::Capacity { name, needed, holds } => Self::Capacity { name: say(name), needed, holds },
            Self::Node { name, alpha, beta, must } => Self::Node { name: say(name), alpha, beta, must },
            Self::Lengths(names) => Self::Lengths(say(names)),
            Self::NotInvertible(why) => Self::NotInvertible(why),
        }
    }
}

/// Refuses NaN and infinities, naming the parameter.
pub(crate) fn finite(name: &'static str, x: f64) -> Result<f64, Error> {
    if x.is_finite() { Ok(x) } else { Err(Error::NonFinite(name)) }
}

/// The coefficient of a parameter in the precision of the signal path; refuses NaN, infinities, and what overflows there.
pub(crate) fn coefficient<T: crate::Real>(name: &'static str, x: f64) -> Result<T, Error> {
    let y = T::from_f64(x);
    if y.is_finite() { Ok(y) } else { Err(Error::NonFinite(name)) }
}

/// Refuses what is not finite or fails `ok`, naming parameter and range.
pub(crate) fn within(name: &'static str, x: f64, ok: bool, must: &'static str) -> Result<f64, Error> {
    finite(name, x)?;
    if ok { Ok(x) } else { Err(Error::OutOfRange { name, must }) }
}
