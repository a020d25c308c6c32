//! Rows from outside of the library, in place of the sources of a design.

use crate::assembly::Assembly;
use crate::config::Diagnostics;
use crate::design::Design;
use crate::rows::Feed;
use core::fmt;
use std::sync::Arc;

/// Makes the feed of a run, for rows that come from somewhere else than the design's sources or simulated world: from
/// live links, or from another program. Without [`FeedMaker::scored`], the run has no reference then.
#[derive(Clone)]
pub struct FeedMaker {
    make: Arc<Make>,
    is_scored: bool,
}

type Make = dyn Fn(&Design, &Assembly) -> Result<Box<dyn Feed>, Diagnostics> + Send + Sync;

impl FeedMaker {
    /// A feed that `make` opens once for a run.
    pub fn new(make: impl Fn(&Design, &Assembly) -> Result<Box<dyn Feed>, Diagnostics> + Send + Sync + 'static) -> Self {
        Self {
            make: Arc::new(make),
            is_scored: false,
        }
    }

    /// The same feed; its estimates are compared with the recorded reference of the design, if there is one.
    #[must_use]
    pub fn scored(self) -> Self {
        Self { is_scored: true, ..self }
    }

    pub(super) const fn is_scored(&self) -> bool {
        self.is_scored
    }

    pub(super) fn make(&self, design: &Design, assembly: &Assembly) -> Result<Box<dyn Feed>, Diagnostics> {
        (self.make)(design, assembly)
    }
}

impl fmt::Debug for FeedMaker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FeedMaker")
    }
}
