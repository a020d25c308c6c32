//! A number made of all estimates, to compare two programs bit by bit.

use fusion_core::belief::Belief;
use fusion_core::runner::{Event, Halt, Observer};

/// Hears the estimates of a filter, and makes one number of all their bits: times, states and covariances, by 64-bit
/// FNV-1a.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest {
    /// The number of estimates.
    pub count: u64,
    /// The hash of all of them.
    pub hash: u64,
}

impl Default for Digest {
    fn default() -> Self {
        Self {
            count: 0,
            hash: 0xcbf2_9ce4_8422_2325,
        }
    }
}

impl Digest {
    /// Adds an estimate.
    pub fn add(&mut self, belief: &Belief) {
        self.count += 1;
        self.bytes(&belief.time.nanos().to_le_bytes());
        for number in &belief.x {
            self.bytes(&number.to_bits().to_le_bytes());
        }
        for number in belief.covariance.to_dense() {
            self.bytes(&number.to_bits().to_le_bytes());
        }
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.hash = (self.hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
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
