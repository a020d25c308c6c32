//! Random numbers of a fault: a generator per row, from the seed and the row's stamp.

use crate::seed::mix;
use fusion_core::time::Time;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// The generator of the row stamped `time`.
pub(super) fn generator(seed: u64, time: Time) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(mix(seed ^ mix(time.nanos().cast_unsigned())))
}

/// Whether a fault that strikes a share `rate` of the rows strikes the one stamped `time`.
pub(super) fn strikes(seed: u64, time: Time, rate: f64) -> bool {
    generator(seed, time).random::<f64>() < rate
}
