//! The failures of the estimators.

use super::{Entry, Keyed, RunEnd, RunEvent, RunObserver, Section, SectionObserver, Summary};
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use schemars::JsonSchema;
use serde::Serialize;

/// The maximum number of failures whose reason is kept.
const REASONS: usize = 10;

/// The failures of all filters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Failures {
    /// Why a filter could not continue: the first ten reasons.
    #[schemars(rename = "failures")]
    pub first: Vec<String>,
    /// The number of further failures.
    #[schemars(rename = "further_failures")]
    pub further: u64,
}

fusion_core::memory!(Failures { first, further });

impl Section for Failures {
    const NAME: &'static str = "failures";

    fn keys(&self) -> Vec<Keyed<'_>> {
        vec![("failures", &self.first), ("further_failures", &self.further)]
    }
}

impl Summary {
    /// The failures of the filters.
    #[must_use]
    pub fn failures(&self) -> &Failures {
        static NONE: Failures = Failures {
            first: Vec::new(),
            further: 0,
        };
        self.get().unwrap_or(&NONE)
    }
}

impl RunObserver for Failures {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Filter {
            filter,
            event: Event::Failed { error },
        } = event
        {
            if self.first.len() >= REASONS {
                self.further += 1;
            } else {
                let stage = filter.stages.join(".");
                self.first.push(match stage.as_str() {
                    "" => error.to_string(),
                    _ => format!("{stage}: {error}"),
                });
            }
        }
        Ok(())
    }
}

impl SectionObserver for Failures {
    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok((*self).into())
    }
}
