//! Logs in other axes: east-north-up worlds, right-forward-up bodies, roll, pitch and heading.

use super::{T, said, values};
use fusion_core::geometry::so3;
use fusion_models::earth::frames::{swap_attitude, swap_axes};
use nalgebra::Vector3;

/// Text of numbers with all their digits.
fn row(numbers: &[f64]) -> String {
    numbers.iter().map(|n| format!("{n:?}")).collect::<Vec<_>>().join(",")
}

#[test]
fn a_log_in_east_north_up_and_right_forward_up_is_that_in_the_axes_of_the_filter() {
    // x_ENU = T x_NED, RFU = T FRD, C_ENU = T C_NED T, as a published navigator prints its states.
    let (q, v, f) = (
        so3::from_rpy(0.2, -0.1, 2.5),
        Vector3::new(1.5, -0.3, 0.1),
        Vector3::new(0.3, -0.2, -9.7),
    );
    let own = so3::to_scalar_first(&so3::canonical(&q));
    let printed = so3::to_scalar_first(&swap_attitude(&q));
    let channels = |quaternion: &str, velocity: &str, force: &str| {
        format!(
            "{T}channels.a = {{ quaternion = ['qw', 'qx', 'qy', 'qz']{quaternion} }}
            channels.b = {{ columns = ['v1', 'v2', 'v3'], unit = 'm/s'{velocity} }}
            channels.c = {{ columns = ['f1', 'f2', 'f3'], unit = 'm/s^2'{force} }}"
        )
    };
    let header = "t,qw,qx,qy,qz,v1,v2,v3,f1,f2,f3\n";
    let numbers = |q: &[f64], v: &Vector3<f64>, f: &Vector3<f64>| [&[1.0], q, v.as_slice(), f.as_slice()].concat();
    let swapped = ", rotation = { axes = ['y', 'x', '-z'] }";
    let both = ", rotation = { axes = ['y', 'x', '-z'] }, navigation_rotation = { axes = ['y', 'x', '-z'] }";
    let ned = values(
        &channels("", "", ""),
        &format!("{header}{}\n", row(&numbers(own.as_slice(), &v, &f))),
    );
    let enu = numbers(printed.as_slice(), &swap_axes(&v), &swap_axes(&f));
    let enu = values(&channels(both, swapped, swapped), &format!("{header}{}\n", row(&enu)));
    for (k, (a, b)) in ned[0].iter().zip(&enu[0]).enumerate() {
        // Quaternions agree up to their sign; 4 ε of 10: rounding of two products.
        let b = if k < 4 { b * (ned[0][0] * enu[0][0]).signum() } else { *b };
        assert!((a - b).abs() < 1e-14, "{k}: {a} {b}");
    }
}

#[test]
fn roll_pitch_and_heading_become_an_attitude_with_their_signs_and_origin() {
    let toml = format!("{T}channels.attitude = {{ rpy = ['r', '-p', '-y'], unit = 'deg', offset = [0, 0, '90 deg'] }}");
    let found = values(&toml, "t,r,p,y\n1,10,5,60\n");
    let want = so3::to_scalar_first(&so3::from_rpy(10f64.to_radians(), -5f64.to_radians(), 30f64.to_radians()));
    // The worked example of the mechanisation has five digits of it.
    let printed = [0.96035, 0.095352, -0.019437, 0.261261];
    for ((a, b), printed) in found[0].iter().zip(want.as_slice()).zip(printed) {
        assert!((a - b).abs() < 1e-15 && (a - printed).abs() < 6e-6, "{found:?}");
    }
    let without = said(&toml.replace("unit = 'deg', ", ""), "t,r,p,y\n1,10,5,60\n");
    assert!(without.contains("an angle needs its unit"), "{without}");
}

/// The decoded numbers of one row whose columns `a`, `b`, … have these values.
fn one(channel: &str, numbers: &[f64]) -> Vec<f64> {
    values(&format!("{T}channels.{channel}"), &table(numbers)).remove(0)
}

fn table(numbers: &[f64]) -> String {
    let names: Vec<String> = ('a'..).take(numbers.len()).map(String::from).collect();
    format!("t,{}\n1,{}\n", names.join(","), row(numbers))
}

#[test]
fn a_vector_in_east_north_up_becomes_one_in_north_east_down_and_its_sigma_stays_positive() {
    assert_eq!(
        one("velocity = { enu = ['a', '-b', 'c'], unit = 'm/s' }", &[1.0, 2.0, 3.0]),
        [-2.0, 1.0, -3.0]
    );
    assert_eq!(
        one("velocity_sigma = { enu = ['a', 'b', 'c'], unit = 'm/s' }", &[1.0, 2.0, 3.0]),
        [2.0, 1.0, 3.0]
    );
    let variance = "s = { enu = ['a', 'b', 'c'], unit = 'm^2', variance = true }";
    assert_eq!(one(variance, &[1.0, 4.0, 9.0]), [2.0, 1.0, 3.0]);
    let turned = "v = { enu = ['a', 'b', 'c'], rotation = { axes = ['y', 'x', '-z'] } }";
    assert!(said(&format!("{T}channels.{turned}"), &table(&[1.0, 2.0, 3.0])).contains("`rotation` does not apply"));
}

#[test]
fn positions_from_the_centre_of_the_earth_and_on_the_grid_are_geodetic() {
    // EPSG:32613 to EPSG:4326 by pyproj 3.7.2.
    let (lat, lon) = (40.097_146_167_055_f64.to_radians(), -105.147_361_317_157_f64.to_radians());
    let frame = fusion_models::earth::frames::ecef_from_geodetic(&fusion_core::geometry::wgs84::Geodetic::new(lat, lon, 1600.0));
    let ecef = one(
        "position = { ecef = ['a', 'b', 'c'], unit = 'km' }",
        &[frame.x / 1e3, frame.y / 1e3, frame.z / 1e3],
    );
    let utm = "position = { utm = { easting = 'a', northing = 'b', zone = 13, hemisphere = 'north' }, height = 'c' }";
    let utm = one(utm, &[487_439.123_4, 4_438_549.987_6, 1600.0]);
    for found in [ecef, utm] {
        // 1e-9 m in the Earth's centre, 1e-12 deg as printed: 2e-14 rad.
        assert!((found[0] - lat).abs() < 3e-14 && (found[1] - lon).abs() < 3e-14, "{found:?}");
        assert!((found[2] - 1600.0).abs() < 3e-9, "{found:?}");
    }
    let wrong = |channel: &str, numbers: &[f64]| said(&format!("{T}channels.{channel}"), &table(numbers));
    let zeros = wrong("p = { ecef = ['a', 'b', 'c'] }", &[0.0; 3]);
    assert!(
        zeros.starts_with("error: 0 m from the Earth's centre is no position\n--> log.csv:2"),
        "{zeros}"
    );
    let utm =
        |zone: &str| format!("p = {{ utm = {{ easting = 'a', northing = 'b', zone = {zone}, hemisphere = 'south' }}, height = 'c' }}");
    let far = wrong(&utm("13"), &[4_438_549.0, 487_439.0, 0.0]);
    assert!(
        far.starts_with("error: easting 4438549 m, northing 487439 m lie outside every zone\n--> log.csv:2"),
        "{far}"
    );
    let zone = wrong(&utm("61"), &[5e5, 0.0, 0.0]);
    assert!(zone.contains("there are zones 1 to 60, not 61"), "{zone}");
    let height = wrong(&utm("13").replace(", height = 'c'", ""), &[5e5, 0.0, 0.0]);
    assert!(height.contains("this channel misses `height`"), "{height}");
}

#[test]
fn an_attitude_of_any_sequence_of_turns_or_of_a_matrix_is_that_of_its_quaternion() {
    let (roll, pitch, yaw) = (0.3, -0.4, 2.5);
    let q = so3::from_rpy(roll, pitch, yaw);
    let c = so3::rotation(&q);
    let same = |found: Vec<f64>, what: &str| {
        let own = so3::to_scalar_first(&q);
        let sign = own.iter().zip(&found).map(|(a, b)| a * b).sum::<f64>().signum();
        for (a, b) in own.iter().zip(&found) {
            // 4 ε: rounding of three products.
            assert!((a - sign * b).abs() < 1e-15, "{what}: {found:?} {own}");
        }
    };
    let zyx = "q = { euler = { order = 'zyx', columns = ['a', 'b', 'c'] }, unit = 'rad' }";
    same(one(zyx, &[yaw, pitch, roll]), "zyx");
    // C = Rx(α) Ry(β) Rz(γ) and C = Rz(α) Rx(β) Rz(γ), solved for their angles by hand.
    let (alpha, beta, gamma) = ((-c[(1, 2)]).atan2(c[(2, 2)]), c[(0, 2)].asin(), (-c[(0, 1)]).atan2(c[(0, 0)]));
    same(one(&zyx.replace("zyx", "xyz"), &[alpha, beta, gamma]), "xyz");
    let (alpha, beta, gamma) = (c[(0, 2)].atan2(-c[(1, 2)]), c[(2, 2)].acos(), c[(2, 0)].atan2(c[(2, 1)]));
    same(one(&zyx.replace("zyx", "ZXZ"), &[alpha, beta, gamma]), "zxz");
    let dcm = "q = { dcm = ['a', 'b', 'c', 'd', 'e', 'f', 'g', 'h', 'i'] }";
    same(one(dcm, c.transpose().as_slice()), "dcm");
    same(
        one(&dcm.replace(" }", ", inverse = true }"), c.as_slice()),
        "dcm of navigation to body",
    );
    let wrong = |channel: &str, numbers: &[f64]| said(&format!("{T}channels.{channel}"), &table(numbers));
    let scaled = wrong(dcm, (c * 1.1).as_slice());
    assert!(
        scaled.starts_with("error: the matrix is not a rotation: its columns are not orthonormal by 0.210\n--> log.csv:2"),
        "{scaled}"
    );
    let mirrored = wrong(dcm, (-c).as_slice());
    assert!(mirrored.contains("turns a right-handed frame into a left-handed one"), "{mirrored}");
    let order = wrong(&zyx.replace("zyx", "zzx"), &[0.0; 3]);
    assert!(order.contains("\"zzx\" is no sequence of turns"), "{order}");
}
