//! The tilt-compensated compass: headings from a magnetometer and the filter's own roll and pitch.
//!
//! Calibrated m = A (m_raw − hard_iron)
//! Output     `heading` ψ + η \[rad\] clockwise from true north, ψ the filter's own yaw and η the turn
//!            about down that brings C_nb m to magnetic north; `attitude` the filter's own, turned by
//!            η; before the filter starts, with the tilt from the specific force;
//!            `magnetic_field` m \[T\], calibrated; with a declared `noise`, `magnetic_field_sigma`,
//!            √(σ² + (k d)²) per axis, d the distance of the field from the undisturbed field
//! Gate       size and dip of the field against the undisturbed ones, learnt at the start
//!            ([`field_gate`])
//! Used by    the sensor `attitude` with `part = "heading"`, which has a heading at any pitch; the
//!            sensor `heading` (its own `declination` is then 0), the initialiser `compass`; the sensor
//!            `magnetometer`, for fields that passed the gate
//! Valid      the error of the heading is the error of the tilt times tan(dip)

pub mod field;
pub mod field_gate;

use field_gate::FieldGate;
use fusion_core::geometry::so3;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Attitude, Quantity, View, wrap};
use fusion_core::time::Time;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct CompassStage {
    attitude: Quantity<Attitude>,
    declination: f64,
    soft_iron: Matrix3<f64>,
    hard_iron: Vector3<f64>,
    gate: Option<FieldGate>,
    /// 1σ of an undisturbed field, and the factor of the difference from it.
    noise: Option<(f64, f64)>,
    period: i64,
    /// The last specific force, for the tilt before there is an estimate.
    force: Option<Vector3<f64>>,
    next: Time,
}

impl Memory for CompassStage {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        if let Some(gate) = &mut self.gate {
            gate.remember(tape);
        }
        self.force.remember(tape);
        self.next.remember(tape);
    }
}

impl Stage for CompassStage {
    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter) {
        let read = Vector3::new(row[0], row[1], row[2]);
        if !row.iter().all(|v| v.is_finite()) || read == Vector3::zeros() {
            return;
        }
        if input == 1 {
            self.force = Some(read);
            return;
        }
        let m = field::calibrated(&read, &self.soft_iron, &self.hard_iron);
        let q = match (view, &self.force) {
            (Some(view), _) => view.get(&self.attitude),
            (None, Some(force)) => field::levelled(&UnitQuaternion::identity(), force),
            (None, None) => return,
        };
        let seen = field::field(&m, &q, self.declination);
        let Some(difference) = self.gate.as_mut().map_or(Some(0.0), |gate| gate.judge(&seen, time)) else {
            return;
        };
        if time >= self.next {
            // Before the start, an initialiser averages all rows.
            if view.is_some() {
                self.next = time.shifted(self.period);
            }
            let (heading, q) = (wrap(so3::to_rpy(&q).z + seen.turn), field::turned(&q, seen.turn));
            let sigma = self.noise.map_or(0.0, |(sigma, times)| math::hypot(sigma, times * difference));
            let row = [heading, q.w, q.i, q.j, q.k, m.x, m.y, m.z, sigma, sigma, sigma];
            out.emit(time, &row[..if self.noise.is_some() { 11 } else { 8 }]);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{self, Dimensional, NonNegative, Positive, Quantity as Unit, Vec3Of, dim};
    use crate::vocabulary::{channel, state};
    use field_gate::FieldGateSpec;
    use fusion_core::time::nanos;
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Headings from a magnetometer, tilt-compensated by the filter's own roll and pitch.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct CompassStageSpec {
        /// A stream with a `magnetic_field` channel, three axes.
        source: String,
        /// A stream with a `specific_force` channel, for the tilt before the filter starts; without it
        /// the body is assumed to be level.
        level_source: Option<String>,
        /// The highest number of headings per second, once the filter has started; before, every field counts.
        #[serde(default = "thirty_hertz")]
        rate: Positive<dim::Frequency>,
        /// Magnetic declination: direction of magnetic north, clockwise from true north.
        #[serde(default)]
        declination: units::Angle,
        /// A of m = A (m_raw − hard_iron), row by row.
        #[serde(default = "no_soft_iron")]
        soft_iron: [Vec3Of<dim::Ratio>; 3],
        /// Magnetic field of the body itself.
        #[serde(default)]
        hard_iron: Vec3Of<dim::MagneticField>,
        /// Which samples of the field are left out; by default all samples are used.
        gate: Option<FieldGateSpec>,
        /// 1σ of the output field, for `noise = { from_source = true }`; needs a gate.
        noise: Option<FieldNoiseSpec>,
    }

    /// The 1σ of a field: √(sigma² + (difference · d)²).
    #[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct FieldNoiseSpec {
        /// 1σ per axis of a field that looks undisturbed.
        sigma: Positive<dim::MagneticField>,
        /// The factor of the difference d from the undisturbed field, horizontal and downward part together. A disturbance
        /// is common to N successive rows: include √N in the factor.
        difference: NonNegative<dim::Ratio>,
    }

    fn thirty_hertz() -> Positive<dim::Frequency> {
        Positive::try_from_si(30.0).unwrap_or_else(|_| unreachable!("30 is positive"))
    }

    /// The matrix without soft iron.
    pub(crate) fn no_soft_iron() -> [Vec3Of<dim::Ratio>; 3] {
        let row = |i: usize| core::array::from_fn(|j| Unit::from_si(f64::from(i == j))).into();
        [row(0), row(1), row(2)]
    }

    crate::register!(
        Stage,
        "compass",
        CompassStageSpec,
        r#"
source = "magnetometer"
level_source = "imu"
rate = "30 Hz"
declination = "-8 deg"
soft_iron = [[1.02, 0, 0], [0, 0.99, 0], [0, 0, 1]]
hard_iron = ["1.2 uT", "-3 uT", 0]
gate = { magnitude = "5 %", dip = "3 deg", smooth_over = "0.1 s", hold_off = "2 s", adopt_after = "60 s", learn_for = "1 s" }
noise = { sigma = "0.8 uT", difference = 5 }
"#
    );

    #[typetag::deserialize(name = "compass")]
    impl StageSpec for CompassStageSpec {
        fn inputs(&self) -> Vec<Listen> {
            let field = channel::MAGNETIC_FIELD;
            let mut inputs = vec![Listen {
                source: self.source.clone(),
                channels: vec![field],
            }];
            if let Some(source) = &self.level_source {
                let force = channel::SPECIFIC_FORCE;
                inputs.push(Listen {
                    source: source.clone(),
                    channels: vec![force],
                });
            }
            inputs
        }

        fn output(&self) -> Vec<Channel> {
            let mut output = vec![channel::HEADING, channel::ATTITUDE, channel::MAGNETIC_FIELD];
            if self.noise.is_some() {
                output.push(Channel::vector("magnetic_field_sigma", 3, dim::MagneticField::KIND.dimension));
            }
            output
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            if self.noise.is_some() && self.gate.is_none() {
                return Err(BuildError::at("noise", "the undisturbed field is known to a gate only").help("declare a `gate`"));
            }
            Ok(Box::new(CompassStage {
                attitude: b.quantity(state::ATTITUDE)?,
                declination: self.declination.si(),
                soft_iron: Matrix3::from_rows(&self.soft_iron.map(|row| Vector3::from(row.si()).transpose())),
                hard_iron: self.hard_iron.si().into(),
                gate: self.gate.map(|g| g.build()),
                noise: self.noise.map(|n| (n.sigma.si(), n.difference.si())),
                period: nanos(1.0 / self.rate.si()),
                force: self.level_source.is_none().then_some(LEVEL),
                next: Time::MIN,
            }))
        }
    }

    /// The specific force, of any size, on a level body.
    const LEVEL: Vector3<f64> = Vector3::new(0.0, 0.0, -1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, StageSpec};
    use crate::vocabulary::state;
    use field_gate::FieldGateSpec;

    fn stage(gate: bool) -> CompassStage {
        CompassStage {
            attitude: Quantity::Fixed(so3::from_rpy(0.3, -0.2, 1.0)),
            declination: -0.1,
            soft_iron: Matrix3::identity(),
            hard_iron: Vector3::zeros(),
            gate: gate.then(|| FieldGateSpec::default().build()),
            noise: None,
            period: 0,
            force: None,
            next: Time::MIN,
        }
    }

    fn heading(stage: &mut dyn Stage, t: f64, m: &Vector3<f64>, view: Option<&View<'_>>) -> Option<f64> {
        let mut out = Emitter::default();
        stage.row(0, Time::from_seconds(t), m.as_slice(), view, &mut out);
        out.rows().next().map(|(_, row)| row[0])
    }

    #[test]
    fn the_heading_is_the_bodys_whatever_yaw_the_filter_has_and_before_it_starts() {
        let m_n = Vector3::new(0.1_f64.cos(), -0.1_f64.sin(), 2.0);
        let q = so3::from_rpy(0.3, -0.2, 2.5);
        let m = q.inverse() * m_n;
        let mut stage = stage(false);
        let view = View::new(&[], &[]);
        assert_eq!(heading(&mut stage, 0.0, &m, None), None, "its tilt is not known");
        // 1e-14: trigonometric functions.
        assert!((heading(&mut stage, 0.0, &m, Some(&view)).unwrap() - 2.5).abs() < 1e-14);
        stage.row(
            1,
            Time::default(),
            (q.inverse() * Vector3::new(0.0, 0.0, -9.8)).as_slice(),
            None,
            &mut Emitter::default(),
        );
        assert!((heading(&mut stage, 1.0, &m, None).unwrap() - 2.5).abs() < 1e-14);
    }

    #[test]
    fn every_field_gives_a_heading_where_there_is_no_gate_or_it_is_not_enabled() {
        let answers = |gate: &str| {
            let mut layout = fusion_core::state::LayoutBuilder::new();
            let mut b = Build {
                name: "compass",
                layout: &mut layout,
                origin: None,
                gravity: crate::earth::Gravity::default(),
            };
            let moved = fusion_core::state::Dynamics::Process;
            b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), vec![0.1; 3], moved)
                .unwrap();
            let spec: CompassStageSpec = toml::from_str(&format!("source = 'magnetometer'\n{gate}")).unwrap();
            let mut stage = spec.build(&mut b).unwrap();
            let layout = layout.finish();
            let view = View::new(layout.initial(), &[]);
            let m = Vector3::new(3e-5, 0.0, 4e-5);
            // Learnt for a second, then multiplied by 1.5.
            let answer = |(t, factor)| heading(stage.as_mut(), t, &(m * factor), Some(&view)).is_some();
            [(0.0, 1.0), (1.0, 1.0), (2.0, 1.5)].map(answer)
        };
        assert_eq!(answers(""), [true; 3]);
        assert_eq!(answers("gate = { enabled = false }"), [true; 3]);
        assert_eq!(answers("gate = {}"), [true, true, false]);
    }

    #[test]
    fn a_disturbed_field_gives_no_heading() {
        let mut stage = stage(true);
        let view = View::new(&[], &[]);
        let m = so3::from_rpy(0.3, -0.2, 2.5).inverse() * Vector3::new(1.0, 0.0, 2.0);
        for k in 0..20 {
            assert!(heading(&mut stage, f64::from(k) * 0.1, &m, Some(&view)).is_some());
        }
        assert!(heading(&mut stage, 2.0, &(m * 1.1), Some(&view)).is_none());
        assert!(heading(&mut stage, 2.1, &m, Some(&view)).is_some());
    }

    #[test]
    fn the_sigma_grows_with_the_difference_from_the_undisturbed_field() {
        let mut stage = CompassStage {
            noise: Some((0.03, 2.0)),
            ..stage(true)
        };
        let (view, level) = (View::new(&[], &[]), so3::from_rpy(0.3, -0.2, 1.0));
        let mut sigma = |t: f64, north: f64, down: f64| {
            let (m, mut out) = (level.inverse() * Vector3::new(north, 0.0, down), Emitter::default());
            stage.row(0, Time::from_seconds(t), m.as_slice(), Some(&view), &mut out);
            out.rows().next().map(|(_, row)| row[8..].to_vec())
        };
        // 1e-12: the field is turned there and back.
        let is = |row: Option<Vec<f64>>, sigma: f64| row.is_some_and(|row| row.len() == 3 && row.iter().all(|s| (s - sigma).abs() < 1e-12));
        assert!(is(sigma(0.0, 1.0, 2.0), 0.03) && is(sigma(2.0, 1.0, 2.0), 0.03));
        // 0.04 more to the north, as much down: √(0.03² + (2·0.04)²).
        let expected = (0.03_f64 * 0.03 + 0.08 * 0.08).sqrt();
        assert!(is(sigma(3.0, 1.04, 2.0), expected) && is(sigma(4.0, 1.0, 1.96), expected));
    }

    #[test]
    fn a_sigma_of_the_field_without_a_gate_is_refused() {
        let spec: CompassStageSpec = toml::from_str("source = 'm'\nnoise = { sigma = '1 uT', difference = 3 }").unwrap();
        let mut layout = fusion_core::state::LayoutBuilder::new();
        let mut build = Build {
            name: "compass",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        let refused = spec.build(&mut build).unwrap_err();
        assert!(refused.field == "noise" && refused.to_string().contains("gate"), "{refused}");
    }
}
