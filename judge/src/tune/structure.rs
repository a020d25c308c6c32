//! Edits of advice, judged by the likelihood of innovations that they were not found on.
//!
//! ```text
//! first half ──▶ edits that somebody advises ──┬──▶ run with each ──▶ nats gained in the second half, with their error
//!            └─▶ slow errors of sensors ───────┘
//! ```
//!
//! Advice sees statistics of a run, and proposes a change of the design: an axis, a latency, a noise. It cannot know
//! whether the change helps. The likelihood of the second half can: advice did not see these rows.

use super::slow::{SlowError, slow_errors};
use crate::likelihood::{Difference, Terms, differences};
use fusion::config::{Diagnostics, Document, Edit};
use fusion::design::Design;
use fusion::run::{Options, run_sharing};
use fusion_models::sim::SharedCourse;
use rayon::prelude::*;

/// Edits of a rule of advice, and what they gain.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The id of the rule.
    pub rule: String,
    /// The edits, which belong together.
    pub edits: Vec<Edit>,
    /// The gain on rows that the rule has not seen; `None` if the two runs share no such rows, or if the edits lead to a
    /// mistake.
    pub gain: Option<Difference>,
    /// The slow error to which the edits give a state.
    pub slow: Option<SlowError>,
}

impl Proposal {
    /// Edits that are not judged yet.
    #[must_use]
    pub fn new(rule: impl Into<String>, edits: Vec<Edit>) -> Self {
        Self {
            rule: rule.into(),
            edits,
            gain: None,
            slow: None,
        }
    }

    /// Whether it gains more likelihood than the 1σ of this gain. `None` if nothing can judge it: it is a guess.
    #[must_use]
    pub fn is_better(&self) -> Option<bool> {
        let gain = self.gain.as_ref().filter(|gain| gain.sigma.is_finite())?;
        Some(gain.nats > gain.sigma)
    }
}

/// The rule of advice that reports innovations which are like the one before.
const LASTING: &str = "innovations-last";

/// Advises on a design.
pub type Advise<'a> = dyn Fn(&Design) -> Result<Vec<Proposal>, Diagnostics> + 'a;

/// Judges the edits that `advise` proposes for the first half of a log, and states for the [slow errors](SlowError) that its
/// innovations show: the second half judges. An edit may say how rows are
/// decoded, so `options` have no rows that another run has decoded.
///
/// # Errors
/// Mistakes of the design or its data, and those of `advise`.
pub fn structure(document: &Document, options: &Options, advise: &Advise<'_>) -> Result<Vec<Proposal>, Diagnostics> {
    let declared = terms(document, options)?;
    let (from, to) = declared.span();
    let middle = 0.5 * (from + to);
    let mut half = document.clone();
    half.apply(&Edit::set("run.stop", format!("\"{middle:?} s\"")))?;
    let judged = |mut proposal: Proposal| {
        proposal.gain = with(document, options, &proposal.edits).ok().and_then(|other| {
            let all = differences(&declared.after(middle), &other.after(middle));
            all.into_iter().next_back()
        });
        proposal
    };
    let slow = slow_errors(&half, options)?;
    let mut proposals = advise(&Design::read(half)?)?;
    proposals.extend(slow.into_iter().map(|(slow, edits)| Proposal {
        slow: Some(slow),
        ..Proposal::new(LASTING, edits)
    }));
    Ok(proposals.into_par_iter().map(judged).collect())
}

/// The likelihood of a design with edits.
fn with(document: &Document, options: &Options, edits: &[Edit]) -> Result<Terms, Diagnostics> {
    let mut document = document.clone();
    edits.iter().try_for_each(|edit| document.apply(edit))?;
    terms(&document, options)
}

fn terms(document: &Document, options: &Options) -> Result<Terms, Diagnostics> {
    let design = Design::read(document.clone())?;
    let mut terms = Terms::new(&design);
    run_sharing(&design, options, &SharedCourse::default(), &mut [&mut terms])?;
    Ok(terms)
}
