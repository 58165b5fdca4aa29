//! How much memory the columns of a file may take.

use std::cell::Cell;
use std::rc::Rc;

/// How many more values the columns of a file may have, all topics together.
#[derive(Clone, Debug)]
pub(crate) struct Room(Rc<Cell<usize>>);

impl Room {
    pub(crate) fn new(values: usize) -> Self {
        Self(Rc::new(Cell::new(values)))
    }

    /// Takes room for so many values; whether there was any.
    pub(crate) fn take(&self, values: usize) -> bool {
        let rest = self.0.get().checked_sub(values);
        self.0.set(rest.unwrap_or(0));
        rest.is_some()
    }

    pub(crate) fn is_used_up(&self) -> bool {
        self.0.get() == 0
    }
}
