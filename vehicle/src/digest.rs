//! A number made of all estimates, to compare two programs bit by bit.

use fusion_core::belief::Belief;
use fusion_core::checkpoint::Fnv;
use fusion_core::runner::{Event, Halt, Observer};

/// Hears the estimates of a filter, and makes one number of all their bits: times, states and covariances, by 64-bit
/// FNV-1a.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Digest {
    /// The number of estimates.
    pub count: u64,
    hash: Fnv,
}

impl Digest {
    /// Adds an estimate.
    pub fn add(&mut self, belief: &Belief) {
        self.count += 1;
        self.hash.bytes(&belief.time.nanos().to_le_bytes());
        for number in &belief.x {
            self.hash.bytes(&number.to_bits().to_le_bytes());
        }
        for number in belief.covariance.elements() {
            self.hash.bytes(&number.to_bits().to_le_bytes());
        }
    }

    /// The hash of all estimates.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        self.hash.value()
    }
}

impl Observer for Digest {
    fn on(&mut self, event: &Event<'_>) -> Result<(), Halt> {
        if let Event::Estimate { belief } = event {
            self.add(belief);
        }
        Ok(())
    }
}
