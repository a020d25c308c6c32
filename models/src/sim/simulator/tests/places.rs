//! Each sensor measures at its own place on the body.

use super::*;
use crate::earth::LocalFrame;
use crate::earth::frames::ecef_from_geodetic;
use fusion_core::geometry::wgs84;

/// A beacon and a transceiver, 50 m and 80 m from the start.
const BEACON: Geodetic = Geodetic::new(0.612_175, 2.252_993, -20.0);
const TRANSCEIVER: Geodetic = Geodetic::new(0.612_167, 2.253_008, 8.0);

/// The sensors, by their names, each with the fields that it has beside its lever arm; and where each is.
fn sensors() -> Vec<(&'static str, String, Vector3<f64>)> {
    let place = |p: &Geodetic| format!("latitude = '{} rad'\nlongitude = '{} rad'\nheight = {}", p.lat, p.lon, p.height);
    let fields = [
        ("gnss_position", String::new()),
        ("gnss_velocity", String::new()),
        ("body_velocity", String::new()),
        ("odometer", String::new()),
        ("dvl", "beam_angle = '30 deg'\nazimuths = [0, '120 deg', '240 deg']".to_owned()),
        ("range", place(&BEACON)),
        ("usbl", format!("position = {{ {} }}", place(&TRANSCEIVER).replace('\n', ", "))),
        ("depth", String::new()),
        ("height", String::new()),
    ];
    let arm = |i: usize| Vector3::new(0.5 + 0.1 * i as f64, -0.3 - 0.2 * i as f64, -1.2 + 0.15 * i as f64);
    fields
        .into_iter()
        .enumerate()
        .map(|(i, (name, fields))| (name, fields, arm(i)))
        .collect()
}

/// The measurement of a perfect sensor `name` at the place `l` on a body in this motion.
fn expected(name: &str, position: &Geodetic, motion: &(Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>), l: &Vector3<f64>) -> Vec<f64> {
    let (v_n, q_nb, w_b) = motion;
    let (place, v_b) = (position.offset(&(q_nb * l)), q_nb.inverse() * v_n + w_b.cross(l));
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    let beam = |azimuth: f64| Vector3::new(sin * azimuth.to_radians().cos(), sin * azimuth.to_radians().sin(), cos).dot(&v_b);
    match name {
        "gnss_position" => place.difference(position).as_slice().to_vec(),
        "gnss_velocity" => (q_nb * v_b).as_slice().to_vec(),
        "body_velocity" => v_b.as_slice().to_vec(),
        "odometer" => vec![v_b.x],
        "dvl" => [0.0, 120.0, 240.0].map(beam).to_vec(),
        "range" => vec![(ecef_from_geodetic(&BEACON) - ecef_from_geodetic(&place)).norm()],
        "usbl" => {
            let s = LocalFrame::new(TRANSCEIVER).to_ned(&place);
            vec![s.norm(), s.y.atan2(s.x), s.z.atan2(s.x.hypot(s.y))]
        }
        "depth" => vec![-place.height],
        _ => vec![place.height],
    }
}

/// The sensors whose rows differ from a perfect sensor at its place, each with its largest error. With `drawn`, the
/// drawn lever arms are the true ones, and differ from the declared lever arms.
fn misplaced(drawn: bool) -> Vec<(&'static str, f64)> {
    let declared = |arm: &Vector3<f64>| {
        let initial = format!("[{}, {}, {}]", arm.x, arm.y, arm.z);
        if drawn {
            format!("{{ estimate = true, initial = {initial}, sigma = '20 cm' }}")
        } else {
            initial
        }
    };
    let (mut text, mut world) = (
        strapdown("one_sample", false),
        format!("draw_parameters = {drawn}\nimu = {{ rate = 1000 }}\n"),
    );
    for (name, fields, arm) in sensors() {
        text += &format!("[sensor.{name}.{name}]\n{fields}\nlever_arm = {}\n", declared(&arm));
        world += &format!("sensor.{name} = {{ rate = 20 }}\n");
    }
    let text = text + &simulation(&format!("{world}reference_rate = 20\n"), &short());
    let design: Design = toml::from_str(&text).unwrap();
    let trajectory = design.simulation.trajectory().unwrap();
    let (layout, _, mut simulator) = simulate(&text, 5).unwrap();
    let (mut row, mut all) = (Vec::new(), std::collections::BTreeMap::<Time, Vec<(String, Vec<f64>)>>::new());
    while let Some(Next::Row(stream, time)) = simulator.next_row(&mut row) {
        let name = simulator.streams()[stream].name.clone();
        if name != "imu" {
            all.entry(time).or_default().push((name, row.clone()));
        }
    }
    let truth = simulator.reference_state().to_vec();
    let mut wrong = Vec::new();
    for (name, _, arm) in sensors() {
        let slot = layout.slot::<Vector<3>>(format!("{name}.lever_arm").as_str());
        let l = if drawn { slot.unwrap().read(&truth) } else { arm };
        assert_eq!(drawn, (l - arm).norm() > 0.02, "{name}: {l}");
        let (mut rows, mut largest, mut allowed) = (0, 0.0_f64, 0.0);
        for (time, at) in &all {
            let of = |stream: &str| at.iter().find(|(name, _)| name == stream).map(|(_, row)| row);
            let (Some(z), Some(truth)) = (of(name), of("reference")) else {
                continue;
            };
            let position = Geodetic::read(truth);
            let motion = (
                Vector3::new(truth[3], truth[4], truth[5]),
                Attitude::read(&truth[6..]),
                trajectory.at(time.seconds()).angular_rate(),
            );
            let z = if name == "gnss_position" {
                wgs84::Geodetic::read(z).difference(&position).as_slice().to_vec()
            } else {
                z.clone()
            };
            let expected = expected(name, &position, &motion, &l);
            // 1 cm/s: the rate of the body is its mean over a millisecond, which changes by 8 rad/s² in the bump, and
            // counts the Earth's, 7e-5 rad/s; of arms of 2 m. 2e-5 m, rad: places by curvature, as sensors take them.
            allowed = if ["gnss_velocity", "body_velocity", "odometer", "dvl"].contains(&name) {
                1e-2
            } else {
                2e-5
            };
            assert_eq!(z.len(), expected.len(), "{name}");
            largest = z.iter().zip(expected).fold(largest, |most, (z, e)| most.max((z - e).abs()));
            rows += 1;
        }
        assert!(rows > 500, "{name}: {rows}");
        if largest > allowed {
            wrong.push((name, largest));
        }
    }
    wrong
}

#[test]
fn a_sensor_measures_at_its_own_place_on_the_body() {
    assert_eq!(misplaced(false), []);
}

#[test]
fn a_lever_arm_that_is_drawn_is_where_the_sensor_is() {
    assert_eq!(misplaced(true), []);
}
