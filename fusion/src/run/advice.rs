//! Advice of all linked advisors: the next things to look at.

use super::Summary;
use crate::config::{Diagnostic, Edit, did_you_mean};
use crate::design::Design;
use crate::observe::Listed;
use core::fmt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Something that a designer should look at.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Finding {
    /// The id of the [`Rule`] that found it.
    pub rule: String,
    /// The subject: a sensor, a source, or a NEES.
    pub about: String,
    /// The observation, with its figures.
    pub evidence: String,
    /// The recommended action.
    pub advice: String,
    /// The edits of the design that the advice names; empty if it needs a decision.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edits: Vec<Edit>,
}

impl Finding {
    /// An empty finding of the rule `id`, to be filled.
    #[must_use]
    pub fn of(id: &str) -> Self {
        Self {
            rule: id.to_owned(),
            ..Self::default()
        }
    }
}

impl Listed for Finding {
    const NAME: &'static str = "findings";
}

/// The evidence and the advice.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.evidence, self.advice)
    }
}

/// A rule of advice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rule {
    /// Its name in results and in `--ignore`: small letters with hyphens.
    pub id: &'static str,
    /// The meaning of its findings, in one sentence.
    pub says: &'static str,
}

/// Makes findings about a run. At the end of a run, every advisor of a linked crate is called.
///
/// ```
/// use fusion::run::{Advisor, Finding, Rule};
///
/// fusion::inventory::submit! {
///     Advisor {
///         name: "short runs",
///         rules: &[Rule { id: "short-run", says: "The run has few epochs." }],
///         advise: |_design, summary, ignored| {
///             let epochs = summary.counts().epochs;
///             let is_short = epochs < 10 && !ignored.has("short-run");
///             let short = is_short.then(|| Finding {
///                 about: "run".to_owned(),
///                 evidence: format!("the run has {epochs} epochs"),
///                 advice: "record a longer log".to_owned(),
///                 ..Finding::of("short-run")
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
    /// Its rules: no finding has another one.
    pub rules: &'static [Rule],
    /// The findings, most important first, without those of ignored rules.
    pub advise: fn(&Design, &Summary, &Ignored) -> Vec<Finding>,
}

crate::inventory::collect!(Advisor);

impl Advisor {
    /// All linked advisors, in the order of their names.
    #[must_use]
    pub fn all() -> Vec<&'static Self> {
        let mut all: Vec<_> = crate::inventory::iter::<Self>.into_iter().collect();
        all.sort_by_key(|advisor| advisor.name);
        all
    }
}

/// The rules that are not applied.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ignored(BTreeSet<String>);

impl Ignored {
    /// These rules.
    ///
    /// # Errors
    /// A name that is no rule of a linked advisor.
    pub fn new<S: AsRef<str>>(ids: &[S]) -> Result<Self, Diagnostic> {
        let known: Vec<&str> = Advisor::all().iter().flat_map(|a| a.rules).map(|rule| rule.id).collect();
        let unknown = ids.iter().map(AsRef::as_ref).find(|id| !known.contains(id));
        if let Some(id) = unknown {
            let error = Diagnostic::error(format!("there is no rule `{id}`"));
            return Err(match did_you_mean(id, &known) {
                Some(meant) => error.help(format!("did you mean `{meant}`?")),
                None => error.help("a finding ends with the id of its rule, in brackets"),
            });
        }
        Ok(Self(ids.iter().map(|id| id.as_ref().to_owned()).collect()))
    }

    /// Whether this rule is ignored.
    #[must_use]
    pub fn has(&self, id: &str) -> bool {
        self.0.contains(id)
    }
}

/// The findings of all advisors.
pub(super) fn findings(design: &Design, summary: &Summary, ignored: &Ignored) -> Vec<Finding> {
    let all = Advisor::all().into_iter();
    all.flat_map(|advisor| (advisor.advise)(design, summary, ignored)).collect()
}
