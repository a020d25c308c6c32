//! Random numbers of a fault: a generator per row, from the seed and the row's stamp.

use fusion_core::time::Time;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// FNV-1a, 64 bit: offset basis and prime.
const BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// The seed of something named, from the seed of the run: FNV-1a over the run's seed and the
/// names, each closed by a byte that no name contains, then mixed. Fixed for ever.
#[must_use]
pub fn derive_seed(run: u64, names: &[&str]) -> u64 {
    let closed = names.iter().flat_map(|name| name.bytes().chain([0xff]));
    let bytes = run.to_le_bytes().into_iter().chain(closed);
    mix(bytes.fold(BASIS, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME)))
}

/// The generator of the row stamped `time`.
pub(super) fn generator(seed: u64, time: Time) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(mix(seed ^ mix(time.nanos().cast_unsigned())))
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014).
const fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixing_matches_the_published_generator() {
        // First outputs of SplitMix64 seeded with 0 (java.util.SplittableRandom reference).
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(mix(0x9e37_79b9_7f4a_7c15), 0x6e78_9e6a_a1b9_65f4);
    }

    #[test]
    fn seeds_differ_by_run_source_and_fault_and_never_change() {
        let seed = derive_seed(1, &["gnss", "outliers"]);
        let others = [
            derive_seed(2, &["gnss", "outliers"]),
            derive_seed(1, &["gnssoutliers"]),
            derive_seed(1, &["gnss", "noise"]),
        ];
        assert!(!others.contains(&seed));
        assert_eq!(seed, PINNED);
    }

    /// A change of this number changes every recorded result.
    const PINNED: u64 = 5_020_274_945_668_701_431;
}
