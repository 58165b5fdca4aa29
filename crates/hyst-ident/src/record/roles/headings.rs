//! What the headings of a file say about the roles of its columns.

use std::ops::Range;

use super::canonical::has;
use super::layout::File;
use super::words::{COMMANDED, INPUT, LOAD, NOT_INPUT, NOT_OUTPUT, OUTPUT, SENSOR, UNKNOWN_UNITS, words_of};
use crate::record::columns::Role;
use crate::record::heading::{Dimension, Heading, words};

/// The headings of a file, as evidence for the roles of its columns.
pub(super) struct Headings<'a> {
    /// Whether the record needs an input; false for a reference.
    pub(super) wants_input: bool,
    pub(super) file: &'a File<'a>,
    pub(super) headings: Vec<Heading>,
}

impl Headings<'_> {
    pub(super) fn name(&self, column: usize) -> &str {
        &self.file.heads[column].name
    }

    pub(super) fn columns(&self) -> Range<usize> {
        0..self.file.heads.len()
    }

    /// Returns whether a column counts the rows and `role` is not the time.
    pub(super) fn is_counter(&self, role: Role, column: usize) -> bool {
        role != Role::Time && self.file.counters.contains(&column)
    }

    /// Returns whether all column names are numbers.
    pub(super) fn is_without_names(&self) -> bool {
        (0..self.headings.len()).all(|at| self.name(at).bytes().all(|byte| byte.is_ascii_digit()))
    }

    /// Returns whether a column has no unit, neither a known nor an unknown one.
    pub(super) fn is_unstated(&self, column: usize) -> bool {
        self.headings[column].unit.is_none() && self.headings[column].unknown.is_none()
    }

    /// Returns whether the name of a column, including its path, has a word of `role`, and its last part has no word of
    /// another role (as in `voltage.Time`).
    pub(super) fn path_suggests(&self, role: Role, column: usize) -> bool {
        const OTHERS: [Role; 5] = [Role::Time, Role::Input, Role::Output, Role::Temperature, Role::Load];
        let own = |other: &Role| self.headings[column].suggests(words_of(*other));
        let is_another = !own(&role) && OTHERS.iter().any(own);
        !is_another && words(self.name(column)).iter().any(|word| words_of(role).contains(&word.as_str()))
    }

    /// Finds a column of text whose heading states a unit of `role`.
    pub(super) fn text_of(&self, role: Role) -> Option<(&str, &str)> {
        let fits = |name: &str| {
            Role::of_column(name) == Some(role) || Heading::parse(name, None).unit.is_some_and(|unit| has(role, unit))
        };
        self.file.texts.iter().find(|(name, _)| fits(name)).map(|(name, example)| (name.as_str(), example.as_str()))
    }

    /// Returns whether the unit of a column fits `role`. If the role is not `required`, its words must fit too.
    pub(super) fn could_be(&self, role: Role, column: usize, required: bool) -> bool {
        let heading = &self.headings[column];
        let Some(unit) = heading.unit else {
            return role == Role::Segment && heading.words == ["segment"];
        };
        has(role, unit)
            && match role {
                Role::Input => required || heading.suggests(INPUT),
                Role::Output => !heading.suggests(LOAD) && (required || heading.suggests(OUTPUT)),
                Role::Load => heading.suggests(LOAD),
                _ => true,
            }
    }

    /// Returns whether the words of a column contradict `role`.
    pub(super) fn contradicts(&self, role: Role, column: usize) -> bool {
        let heading = &self.headings[column];
        match role {
            Role::Input => heading.suggests(NOT_INPUT) && !heading.suggests(&["drive", "input", "voltage", "command"]),
            // In a reference the output column is the target.
            Role::Output => self.wants_input && heading.suggests(NOT_OUTPUT),
            _ => false,
        }
    }

    /// Returns those of several columns that the words of their headings prefer.
    pub(super) fn preferred(&self, role: Role, several: &[usize]) -> Vec<usize> {
        let with = |words: &[&str], is: bool| {
            several.iter().copied().filter(|at| self.headings[*at].suggests(words) == is).collect::<Vec<_>>()
        };
        let by_word = with(words_of(role), true);
        match role {
            // The measured output, not the reference.
            Role::Output => {
                let measured = with(COMMANDED, false);
                let by_word: Vec<usize> = by_word.into_iter().filter(|at| measured.contains(at)).collect();
                if measured.len() != 1 && by_word.len() == 1 {
                    return by_word;
                }
                let lengths =
                    |at: &usize| self.headings[*at].unit.is_some_and(|unit| unit.dimension == Dimension::Length);
                if measured.len() == 1 { measured } else { measured.iter().copied().filter(lengths).collect() }
            }
            Role::Input => {
                let driven = with(SENSOR, false);
                let by_word: Vec<usize> = by_word.into_iter().filter(|at| driven.contains(at)).collect();
                if by_word.len() == 1 { by_word } else { driven }
            }
            _ => by_word,
        }
    }

    /// Returns whether the column of an optional role ends in a unit that is not supported.
    pub(super) fn states_unknown_unit(&self, role: Role, column: usize) -> bool {
        let heading = &self.headings[column];
        match role {
            Role::Temperature | Role::Load => {
                heading.words.len() == 2 && heading.unit.is_none() && UNKNOWN_UNITS.contains(&heading.words[1].as_str())
            }
            _ => false,
        }
    }
}
