//! Errors of parameters.

use core::fmt;

/// The reason why coefficients or an inverse cannot be built. Each variant names the parameter.
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
    /// There are more elements than the capacity of the stage's type.
    Capacity {
        /// The elements.
        name: &'static str,
        /// Number of elements that are needed.
        needed: usize,
        /// Capacity of the type.
        holds: usize,
    },
    /// A node of a table over (α, β) violates a rule.
    Node {
        /// The table.
        name: &'static str,
        /// Index of the node along α.
        alpha: usize,
        /// Index of the node along β.
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
    /// Returns the error of a part with the names of the model that contains the part. Each pair is the name in the
    /// part and the name in the model's file: `("preisach.low", "dpm.preisach.low")`. Other names are not changed.
    ///
    /// Use it for a part with many names: the comparison costs flash. For few names, a `match` where the part is built
    /// costs none, because the compiler knows the possible errors there.
    #[cold]
    pub(crate) fn in_words(self, words: &[(&'static str, &'static str)]) -> Self {
        let renamed = |own| words.iter().find(|(part, _)| *part == own).map_or(own, |(_, whole)| *whole);
        match self {
            Self::NonFinite(name) => Self::NonFinite(renamed(name)),
            Self::OutOfRange { name, must } => Self::OutOfRange { name: renamed(name), must: renamed(must) },
            Self::Capacity { name, needed, holds } => Self::Capacity { name: renamed(name), needed, holds },
            Self::Node { name, alpha, beta, must } => Self::Node { name: renamed(name), alpha, beta, must },
            Self::Lengths(names) => Self::Lengths(renamed(names)),
            Self::NotInvertible(why) => Self::NotInvertible(why),
        }
    }
}

/// Rejects NaN and infinities, and names the parameter.
pub(crate) fn finite(name: &'static str, x: f64) -> Result<f64, Error> {
    if x.is_finite() { Ok(x) } else { Err(Error::NonFinite(name)) }
}

/// Returns a parameter in the precision of the signal path. Rejects NaN, infinities and values that overflow there.
pub(crate) fn coefficient<T: crate::Real>(name: &'static str, x: f64) -> Result<T, Error> {
    let y = T::from_f64(x);
    if y.is_finite() { Ok(y) } else { Err(Error::NonFinite(name)) }
}

/// Rejects a value that is not finite or violates `ok`, and names parameter and range.
pub(crate) fn within(name: &'static str, x: f64, ok: bool, must: &'static str) -> Result<f64, Error> {
    finite(name, x)?;
    if ok { Ok(x) } else { Err(Error::OutOfRange { name, must }) }
}
