//! With the feature `libm`, a process computes the same bits on every platform.

use super::{Bench, state, steady};
use crate::registry::{self, Registration, Role};
use crate::seed::fnv1a;
use fusion_core::linear::Transition;
use fusion_core::model::Input;
use fusion_core::testing::Lcg;

const DT: f64 = 0.01;
const STEPS: usize = 200;

/// The bits of the state, Φ and Q after each of [`STEPS`] steps, as a hash.
///
/// A new process is added here, with the number that the failed test prints.
const KNOWN: &[(&str, u64)] = &[
    ("attitude_only", 4_093_559_255_691_983_120),
    ("constant_velocity", 1_410_562_345_888_462_772),
    ("dead_reckoning", 12_327_093_437_459_522_354),
    ("hold", 9_548_245_372_834_713_909),
    ("planar_odometry", 836_407_645_672_767_219),
    ("strapdown", 15_514_985_691_539_047_687),
    ("strapdown_external_attitude", 9_310_178_564_571_241_560),
    ("strapdown_local", 7_152_287_112_191_647_092),
    ("unicycle", 10_596_969_015_634_084_796),
];

#[test]
fn every_process_gives_its_known_bits() {
    crate::link();
    let all: Vec<&Registration> = registry::all().into_iter().filter(|r| r.role == Role::Process).collect();
    let found: Vec<(&str, u64)> = all.iter().map(|r| (r.name, bits(r))).collect();
    assert_eq!(found, KNOWN);
}

fn bits(r: &Registration) -> u64 {
    let bench = Bench::new(r).expect("its example builds");
    let layout = bench.layout.so_far();
    let mut random = Lcg::new(1);
    let mut x = state(layout, &mut random);
    let mut transition = Transition::new(layout);
    let mut hash = 0;
    for _ in 0..STEPS {
        let sample = bench.sample(&mut random).expect("its channels fit");
        let input = Input {
            sample: &steady(bench.process.as_ref(), &sample),
            interval: DT,
        };
        transition.reset();
        bench.process.step(&mut x, &input, DT, &mut transition);
        let n = layout.dim();
        let phi = (0..n * n).map(|k| transition.phi.get(k / n, k % n));
        let noise = transition.noise_before().chain(transition.noise_after()).map(|(_, _, value)| value);
        let numbers = x.iter().copied().chain(phi).chain(noise);
        hash = fnv1a(
            numbers
                .flat_map(|number| number.to_bits().to_le_bytes())
                .chain(u64::to_le_bytes(hash)),
        );
    }
    hash
}
