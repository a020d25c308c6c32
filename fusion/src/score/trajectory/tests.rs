//! Compares with results of evo 1.38.1, computed by tests/suite/by_evo.py on the same trajectory.

use super::*;

/// 400 poses on a closed curve; the estimate is turned, shifted, too large by up to 1/1000, and not smooth.
fn made() -> Vec<PosePair> {
    let turned = |yaw, pitch, roll| so3::from_rpy(roll, pitch, yaw);
    let motion = turned(0.3, 0.0, 0.02);
    let pair = |k: i32| {
        let k = f64::from(k);
        let at = |rate: f64| (rate * k).sin_cos();
        let place = Vector3::new(20.0 * at(0.02).1, 15.0 * at(0.03).0, 2.0 * at(0.05).0);
        let attitude = turned(0.02 * k, 0.05 * at(0.07).1, 0.1 * at(0.1).0);
        let noise = Vector3::new(0.05 * at(1.3).0, 0.04 * at(2.1).1, 0.03 * at(0.7).0);
        let small = so3::exp(&(0.01 * Vector3::new(at(0.9).0, at(0.4).1, at(0.2).0)));
        PosePair {
            time: Time::from_seconds(0.1 * k),
            estimate: Pose {
                position: motion * (place * (1.0 + 1e-3 * k / 400.0)) + Vector3::new(1.0, -2.0, 0.5) + noise,
                attitude: Some(motion * attitude * small),
            },
            reference: Pose {
                position: place,
                attitude: Some(attitude),
            },
        }
    };
    (0..400).map(pair).collect()
}

/// Count, and RMSE, mean, median, standard deviation, minimum and maximum, with twelve digits.
fn assert_is(found: &Statistics, count: usize, evo: [f64; 6]) {
    let found_six = [found.rmse, found.mean, found.median, found.std, found.min, found.max];
    assert_eq!(found.count, count, "{found:?}");
    for (found, evo) in found_six.iter().zip(evo) {
        // 1e-10 m, 1e-10 deg: twelve digits are pinned, and evo rounds attitudes as matrices.
        assert!((found - evo).abs() < 1e-10, "{found_six:?} is not {evo:?}");
    }
}

#[test]
fn absolute_errors_match_evo_without_and_with_alignment() {
    let found = Trajectory::of(&made(), &TrajectoryRules::default(), false);
    let evo = [
        (
            [
                5.48099323821,
                5.14359163068,
                4.16569894771,
                1.89334413515,
                3.27162736567,
                9.68606909465,
            ],
            [
                17.2494258089,
                17.2446988552,
                17.2562811237,
                0.403797141274,
                16.5964075328,
                17.9023563522,
            ],
        ),
        (
            [
                0.223619241652,
                0.206480506971,
                0.225991272595,
                0.0858566565737,
                0.0146286298671,
                0.341679296698,
            ],
            [
                1.34412584823,
                1.28844041254,
                1.31065850336,
                0.382878047425,
                0.374723366057,
                2.0268318023,
            ],
        ),
        (
            [
                0.0509452050285,
                0.0492370362703,
                0.0505306156133,
                0.0130815967952,
                0.0149382158779,
                0.0791767780475,
            ],
            [
                0.70093294082,
                0.685746719216,
                0.683985400578,
                0.145115211504,
                0.38079373424,
                0.973303863098,
            ],
        ),
    ];
    assert_eq!((found.absolute.len(), found.poses, found.attitudes), (3, 400, 400));
    for (found, (metres, degrees)) in found.absolute.iter().zip(evo) {
        assert_is(&found.position, 400, metres);
        assert_is(&found.rotation_deg.unwrap(), 400, degrees);
    }
}

#[test]
fn relative_errors_match_evo_over_consecutive_and_over_all_pairs() {
    let of = |pairs| {
        let rules = TrajectoryRules {
            distances: vec![1.0, 10.0, 1e4],
            pairs,
            ..TrajectoryRules::default()
        };
        Trajectory::of(&made(), &rules, false).relative
    };
    let found = [of(Pairs::Consecutive), of(Pairs::All)].concat();
    let evo = [
        (
            137,
            [
                0.0819323354465,
                0.0774904562045,
                0.0815227605107,
                0.0266108396888,
                0.0070255734076,
                0.13159134578,
            ],
            [
                0.913014110423,
                0.868584822624,
                0.917926719903,
                0.281345289169,
                0.233137334675,
                1.40406397193,
            ],
        ),
        (
            16,
            [
                0.102828060081,
                0.0960186383786,
                0.0945798145367,
                0.0367971605426,
                0.034193908301,
                0.175358410737,
            ],
            [
                0.980495940027,
                0.923049656403,
                0.948737316529,
                0.330683565097,
                0.293442384992,
                1.57703717157,
            ],
        ),
        (
            216,
            [
                0.0817502918216,
                0.0777760462576,
                0.0780134481391,
                0.0251792939031,
                0.00800604975316,
                0.129008534376,
            ],
            [
                0.863166430321,
                0.808541059927,
                0.816215430004,
                0.302188088525,
                0.0829047928763,
                1.61898970982,
            ],
        ),
        (
            381,
            [
                0.116706316232,
                0.109271913307,
                0.107018378015,
                0.0409879642173,
                0.0179146642156,
                0.227369930056,
            ],
            [
                1.02768049525,
                0.970265112651,
                1.01735537161,
                0.338692798104,
                0.166990931982,
                1.62030292001,
            ],
        ),
    ];
    // The path is shorter than 10 km.
    assert_eq!(found.len(), evo.len());
    for (found, (count, metres, degrees)) in found.iter().zip(evo) {
        assert_is(&found.position, count, metres);
        assert_is(&found.rotation_deg.unwrap(), count, degrees);
    }
}

#[test]
fn relative_errors_do_not_depend_on_the_axes_of_the_reference() {
    let turn = so3::from_rpy(0.0, 0.0, core::f64::consts::PI);
    let errors = |align, is_turned: bool, has_attitude: bool| {
        let turned = |pose: Pose| Pose {
            position: if is_turned { turn * pose.position } else { pose.position },
            attitude: pose.attitude.map(|q| if is_turned { turn * q } else { q }).filter(|_| has_attitude),
        };
        let only = |pose: Pose| Pose {
            attitude: pose.attitude.filter(|_| has_attitude),
            ..pose
        };
        let pair = |pair: PosePair| PosePair {
            estimate: only(pair.estimate),
            reference: turned(pair.reference),
            ..pair
        };
        let pairs: Vec<PosePair> = made().into_iter().map(pair).collect();
        let rules = TrajectoryRules {
            align,
            distances: vec![10.0],
            ..TrajectoryRules::default()
        };
        Trajectory::of(&pairs, &rules, false).relative[0].position.rmse
    };
    // In body axes of each pose, as in evo, for any alignment.
    for align in Alignment::ALL {
        let [as_it_is, turned] = [false, true].map(|is_turned| errors(align, is_turned, true));
        // 1e-12 m: rounding.
        assert!((turned - as_it_is).abs() < 1e-12, "{align}: {as_it_is} {turned}");
    }
    // Displacements alone depend on the alignment.
    for align in [Alignment::Yaw, Alignment::Se3] {
        let [as_it_is, turned] = [false, true].map(|is_turned| errors(align, is_turned, false));
        assert!((turned - as_it_is).abs() < 1e-12 && turned < 1.0, "{align}: {as_it_is} {turned}");
    }
    // A path of ten metres there and ten back.
    assert!(errors(Alignment::None, true, false) > 15.0);
}

#[test]
fn a_line_has_no_alignment_about_itself_and_a_point_none_about_the_vertical() {
    let line = |length: f64| {
        let pose = |k: i32| Pose {
            position: Vector3::new(length * f64::from(k), 0.0, 0.0),
            attitude: None,
        };
        let pair = |k| PosePair {
            time: Time::from_seconds(f64::from(k)),
            estimate: pose(k),
            reference: pose(k),
        };
        let pairs: Vec<PosePair> = (0..20).map(pair).collect();
        Trajectory::of(&pairs, &TrajectoryRules::default(), false)
    };
    let aligned = |found: &Trajectory| found.absolute.iter().map(|a| a.align).collect::<Vec<_>>();
    let found = line(1.0);
    assert_eq!(aligned(&found), [Alignment::None, Alignment::Yaw]);
    // A path of 19 m contains one metre five times, but not ten metres.
    assert_eq!(found.relative.iter().map(|r| r.distance).collect::<Vec<_>>(), [1.0]);
    assert!(found.relative[0].rotation_deg.is_none() && found.attitudes == 0);
    assert_eq!(aligned(&line(0.0)), [Alignment::None]);
}

#[test]
fn poses_are_cartesian_and_may_come_from_two_references() {
    use crate::score::{Comparison, ReferenceEpoch};
    use crate::solution::Solution;
    use nalgebra::Matrix3;
    let origin = Geodetic::new(0.8, 0.2, 500.0);
    let far = LocalFrame::new(origin).to_geodetic(&Vector3::new(3000.0, 40_000.0, 100.0));
    let q = so3::from_rpy(0.1, -0.2, 1.0);
    let (mut poses, mut epochs) = (Poses::default(), Vec::new());
    for (k, place) in [origin, far].into_iter().enumerate() {
        let time = Time::from_seconds(k as f64);
        // The attitude comes from another reference, at the same time.
        let attitude = ReferenceEpoch {
            time,
            attitude: Some(q),
            ..ReferenceEpoch::default()
        };
        let position = ReferenceEpoch {
            time,
            position: Some(place),
            ..ReferenceEpoch::default()
        };
        epochs.extend([(attitude, place), (position, place)]);
    }
    let mut comparison = Comparison::new(Vector3::zeros(), epochs.iter().map(|(epoch, _)| *epoch));
    for (epoch, place) in epochs.iter().step_by(2) {
        let estimate = Solution {
            time: epoch.time,
            position: Some((*place, Matrix3::identity())),
            attitude: Some((q, Matrix3::identity())),
            ..Solution::default()
        };
        let tell = |_: &ReferenceEpoch, error: Option<&EpochError>| {
            error.into_iter().for_each(|error| poses.add(error));
            Ok::<_, core::convert::Infallible>(())
        };
        comparison.reach(&estimate, None, tell).unwrap();
    }
    let pairs = poses.pairs(&UnitQuaternion::identity());
    assert_eq!(pairs.len(), 2);
    // 1e-8 m: rounding of numbers of the size of the Earth; 40 km away the vertical is different.
    assert!((pairs[1].reference.position - Vector3::new(3000.0, 40_000.0, 100.0)).amax() < 1e-8);
    let turned = pairs[1].estimate.attitude.unwrap();
    assert!((40_000.0 / 6.38e6 - turned.angle_to(&q)).abs() < 3e-3 && pairs[1].rotation().is_some());
    assert!(turned.angle_to(&q) > 5e-3);
}
