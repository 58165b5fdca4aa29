//! A limit on the memory of the columns of a file.

use std::cell::Cell;
use std::rc::Rc;

/// The number of values that the columns of all topics may still add.
#[derive(Clone, Debug)]
pub(crate) struct Budget(Rc<Cell<usize>>);

impl Budget {
    pub(crate) fn new(values: usize) -> Self {
        Self(Rc::new(Cell::new(values)))
    }

    /// Reserves memory for `values`. Returns false if the limit is exceeded.
    pub(crate) fn take(&self, values: usize) -> bool {
        let rest = self.0.get().checked_sub(values);
        self.0.set(rest.unwrap_or(0));
        rest.is_some()
    }

    pub(crate) fn is_used_up(&self) -> bool {
        self.0.get() == 0
    }
}
