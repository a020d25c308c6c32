//! The Earth's field, and that of the body, as a magnetometer measures them.

use super::*;
use crate::earth::magnetic;

/// The rows of a magnetometer as fields in north, east, down, with what disturbs them taken away: the soft iron
/// declared, and the hard iron that is true.
fn fields(declared: &str, draws: bool, seed: u64) -> (Vec<Vector3<f64>>, Layout, Vec<f64>) {
    let text = strapdown("one_sample", false)
        + &format!("[sensor.mag.magnetometer]\n{declared}\nsoft_iron = [[1.02, 0, 0.01], [0, 0.99, 0], [0.01, 0, 1]]\n")
        + "hard_iron = { estimate = true, initial = ['1 uT', 0, 0], sigma = '3 uT' }\n"
        + &simulation(
            &format!("draw_parameters = {draws}\nimu = {{ rate = 50 }}\nsensor.mag = {{ rate = 10 }}"),
            &short(),
        );
    let (layout, _, mut simulator) = simulate(&text, seed).unwrap();
    let (mut row, mut attitudes, mut raw) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(Next::Row(stream, _)) = simulator.next_row(&mut row) {
        match simulator.streams()[stream].name.as_str() {
            "mag" => raw.push(Vector3::new(row[0], row[1], row[2])),
            "reference" => attitudes.push(Attitude::read(&row[6..])),
            _ => {}
        }
    }
    let truth = simulator.reference_state().to_vec();
    let hard_iron = layout.slot::<Vector<3>>("mag.hard_iron").unwrap().read(&truth);
    let soft_iron = nalgebra::Matrix3::new(1.02, 0.0, 0.01, 0.0, 0.99, 0.0, 0.01, 0.0, 1.0);
    assert!(raw.len() > 300 && raw.len() == attitudes.len(), "{} {}", raw.len(), attitudes.len());
    let field = |(raw, q_nb): (&Vector3<f64>, &UnitQuaternion<f64>)| q_nb * (soft_iron * (raw - hard_iron));
    (raw.iter().zip(&attitudes).map(field).collect(), layout, truth)
}

/// That every one of `fields` has this strength [T], inclination and declination [rad].
fn assert_fields(fields: &[Vector3<f64>], [strength, inclination, declination]: [f64; 3]) {
    for m in fields {
        let below = m.z.atan2(m.x.hypot(m.y));
        // 1e-12 of the field: rounding.
        assert!((m.norm() / strength - 1.0).abs() < 1e-12, "{m}");
        assert!(
            (below - inclination).abs() < 1e-12 && (m.y.atan2(m.x) - declination).abs() < 1e-12,
            "{m}"
        );
    }
}

#[test]
fn the_field_is_the_one_declared_whatever_the_iron_of_the_body() {
    let declared = "strength = '50 uT'\ninclination = '51 deg'\ndeclination = '-8 deg'";
    let of_earth = [50e-6, 51_f64.to_radians(), -8_f64.to_radians()];
    for draws in [false, true] {
        let (fields, layout, truth) = fields(declared, draws, 2);
        let hard_iron = layout.slot::<Vector<3>>("mag.hard_iron").unwrap().read(&truth);
        assert_eq!(draws, hard_iron != Vector3::new(1e-6, 0.0, 0.0), "{hard_iron}");
        assert_fields(&fields, of_earth);
    }
}

#[test]
fn a_field_that_is_estimated_is_drawn() {
    let declared = "strength = { estimate = true, initial = '50 uT', sigma = '2 uT' }\n\
         inclination = { estimate = true, initial = '51 deg', sigma = '2 deg' }\ndeclination = '-8 deg'";
    let (fields, layout, truth) = fields(declared, true, 2);
    let read = |name: &str| layout.slot::<Scalar>(name).unwrap().read(&truth);
    let (strength, inclination) = (read("mag.strength"), read("mag.inclination"));
    assert!((strength - 50e-6).abs() > 1e-8 && (inclination - 51_f64.to_radians()).abs() > 1e-4);
    assert_fields(&fields, [strength, inclination, -8_f64.to_radians()]);
}

#[test]
fn the_field_of_a_day_is_that_of_the_world_magnetic_model() {
    let Ok(field) = magnetic::world_model(&ORIGIN, "2026-11-22") else {
        eprintln!("skipped: built without `wmm`");
        return;
    };
    // Korea: 50 uT, 51 deg below the horizon, 8 deg west.
    assert!(
        (field.strength - 50e-6).abs() < 1e-6 && (field.declination.to_degrees() + 8.0).abs() < 1.0,
        "{field:?}"
    );
    let (fields, ..) = fields("date = '2026-11-22'", false, 2);
    assert_fields(&fields, [field.strength, field.inclination, field.declination]);
}
