//! The solution that is read once, and only where it is looked at.

use super::{Solution, SolutionReader};
use core::cell::{OnceCell, RefCell};
use core::fmt;
use core::ops::Deref;
use fusion_core::state::Belief;

/// The solution of a belief. It is read when it is looked at for the first time.
pub struct Solved<'a> {
    reader: RefCell<&'a mut SolutionReader>,
    belief: &'a Belief,
    solution: OnceCell<Solution>,
}

impl<'a> Solved<'a> {
    pub(super) const fn new(reader: &'a mut SolutionReader, belief: &'a Belief) -> Self {
        Self {
            reader: RefCell::new(reader),
            belief,
            solution: OnceCell::new(),
        }
    }
}

impl Deref for Solved<'_> {
    type Target = Solution;

    fn deref(&self) -> &Solution {
        self.solution.get_or_init(|| self.reader.borrow_mut().read(self.belief))
    }
}

impl fmt::Debug for Solved<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
