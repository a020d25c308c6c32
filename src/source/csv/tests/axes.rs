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
