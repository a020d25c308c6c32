//! The solution that is read once, and only where it is looked at.

use super::{Solution, SolutionReader};
use core::cell::{OnceCell, RefCell};
use core::fmt;
use core::ops::Deref;
use fusion_core::belief::Belief;

/// The solution of a belief. It has been read, or is when it is looked at for the first time.
pub struct Solved<'a>(Reading<'a>);

#[expect(clippy::large_enum_variant, reason = "one at a time, on the stack")]
enum Reading<'a> {
    Done(&'a Solution),
    Due {
        reader: RefCell<&'a mut SolutionReader>,
        belief: &'a Belief,
        solution: OnceCell<Solution>,
    },
}

impl<'a> Solved<'a> {
    /// The solution of `belief`, read when somebody looks at it.
    pub(crate) const fn new(reader: &'a mut SolutionReader, belief: &'a Belief) -> Self {
        Self(Reading::Due {
            reader: RefCell::new(reader),
            belief,
            solution: OnceCell::new(),
        })
    }
}

impl<'a> From<&'a Solution> for Solved<'a> {
    fn from(solution: &'a Solution) -> Self {
        Self(Reading::Done(solution))
    }
}

impl Deref for Solved<'_> {
    type Target = Solution;

    fn deref(&self) -> &Solution {
        match &self.0 {
            Reading::Done(solution) => solution,
            Reading::Due { reader, belief, solution } => solution.get_or_init(|| *reader.borrow_mut().read(belief)),
        }
    }
}

impl fmt::Debug for Solved<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
