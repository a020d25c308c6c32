//! The laws of `fusion_core::testing`, applied to every registered block; how, see
//! `fusion_models::testing`.

use fusion_core::state::Kind;
use fusion_core::testing::{Lcg, check_kind};
use fusion_models::registry::{self, Role};
use fusion_models::testing::check;

/// Every block of a role obeys its laws, and there is one.
fn all_obey(role: Role) {
    fusion_models::link();
    let mut tried = 0;
    for r in registry::all().into_iter().filter(|r| r.role == role) {
        check(r).unwrap_or_else(|e| panic!("{e}"));
        tried += 1;
    }
    assert!(tried > 0, "no {} is registered", role.name());
}

#[test]
fn no_name_is_registered_twice() {
    fusion_models::link();
    registry::refuse_duplicates().unwrap();
}

#[test]
fn every_stage_obeys_the_laws_of_stages_on_every_process_that_suits_it() {
    all_obey(Role::Stage);
}

#[test]
fn every_initialiser_obeys_the_laws_of_initialisers_on_every_process_that_suits_it() {
    all_obey(Role::Initialiser);
}

#[test]
fn every_fault_obeys_the_laws_of_faults() {
    all_obey(Role::Fault);
}

#[test]
fn every_segment_obeys_the_laws_of_segments() {
    all_obey(Role::Segment);
}

#[test]
fn every_vehicle_controller_and_task_obeys_its_laws() {
    [Role::Vehicle, Role::Control, Role::Task].into_iter().for_each(all_obey);
}

#[test]
fn every_process_obeys_the_laws_of_processes() {
    all_obey(Role::Process);
}

#[test]
fn every_sensor_obeys_the_laws_of_measurements_on_every_process_that_takes_it() {
    all_obey(Role::Sensor);
}

#[test]
fn every_gate_obeys_the_laws_of_gates() {
    all_obey(Role::Gate);
}

#[test]
fn every_loss_obeys_the_laws_of_losses() {
    all_obey(Role::Loss);
}

#[test]
fn every_kind_of_block_obeys_the_laws_of_plus_and_minus() {
    let mut random = Lcg::new(7);
    for _ in 0..200 {
        let q = fusion_core::geometry::so3::from_rpy(3.0 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed());
        let geodetic = [
            1.5 * random.signed(),
            core::f64::consts::PI * random.signed(),
            1e4 * random.signed(),
        ];
        let attitude = [q.w, q.i, q.j, q.k];
        let three = [random.signed(), random.signed(), random.signed()].map(|v| v * 1.8);
        for (kind, x) in [
            (Kind::Geodetic, &geodetic[..]),
            (Kind::Position, &three),
            (Kind::Velocity, &three),
            (Kind::Attitude, &attitude),
            (Kind::Scalar, &three[..1]),
            (Kind::Angle, &three[..1]),
            (Kind::Vector(2), &three[1..]),
        ] {
            check_kind(kind, x, &three[..kind.dim()]).unwrap();
        }
    }
}
