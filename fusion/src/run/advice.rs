//! Advice of all linked advisors: the next things to look at.

use super::Summary;
use crate::design::Design;
use core::fmt;
use serde::{Deserialize, Serialize};

/// Something that a designer should look at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// The subject: a sensor, a source, or a NEES.
    pub about: String,
    /// The observation, with its figures.
    pub evidence: String,
    /// The recommended action.
    pub advice: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.evidence, self.advice)
    }
}

/// Makes findings about a run. At the end of a run, every advisor of a linked crate is called.
///
/// ```
/// use fusion::run::{Advisor, Finding};
///
/// fusion::inventory::submit! {
///     Advisor {
///         name: "short runs",
///         advise: |_design, summary| {
///             let short = (summary.epochs < 10).then(|| Finding {
///                 about: "run".to_owned(),
///                 evidence: format!("the run has {} epochs", summary.epochs),
///                 advice: "record a longer log".to_owned(),
///             });
///             short.into_iter().collect()
///         },
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Advisor {
    /// Advisors are called in the order of their names.
    pub name: &'static str,
    /// The findings, most important first.
    pub advise: fn(&Design, &Summary) -> Vec<Finding>,
}

crate::inventory::collect!(Advisor);

/// The findings of all advisors.
pub(super) fn findings(design: &Design, summary: &Summary) -> Vec<Finding> {
    let mut all: Vec<_> = crate::inventory::iter::<Advisor>.into_iter().collect();
    all.sort_by_key(|advisor| advisor.name);
    all.into_iter().flat_map(|advisor| (advisor.advise)(design, summary)).collect()
}
