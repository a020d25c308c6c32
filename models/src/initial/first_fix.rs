//! Position and velocity from the latest fix before the start, or the median of the latest few.
//!
//! A fix gives the position of the antenna. The body is at  r_fix − C_nb l_ba_b, with the attitude that earlier
//! initialisers in the file have found. The uncertainty of this attitude moves the lever arm and goes into the 1σ: per
//! axis the variance of C_nb [l ×] P_att [l ×]ᵀ C_nbᵀ, at most |l|². If no attitude is known: |l|² and no shift. The
//! velocity is that of the antenna: the model is not for a body that turns at the start.
//!
//! Carried   a fix is older than the start by Δt:  r ← r + v Δt, with the velocity v. Without a velocity, the mean
//!           velocity between the latest two fixes times Δt goes into the 1σ
//! Aged      velocities v_1, v_2 at t_1, t_2: the acceleration |v_2 − v_1| / (t_2 − t_1) times the age of v_2 goes into
//!           the 1σ of the velocity, and the 1σ of the velocity times Δt into that of the position
//!
//! With a declared 1σ, the fix counts as independent information. A slow error is also in the later fixes, so it would
//! count twice: with the 1σ σ_b of that error and the 1σ σ of the start, the 1σ of the position is too small by √(1 +
//! σ_b²/σ²).

use super::{known_attitude, write_position, write_velocity};
use alloc::borrow::ToOwned;
use alloc::collections::VecDeque;
use alloc::string::String;
use alloc::vec::Vec;
use fusion_core::belief::Belief;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::Initialiser;
use fusion_core::state::{Layout, Manifold};
use fusion_core::time::Time;
use nalgebra::Vector3;

/// The runtime initialiser.
#[derive(Clone, Debug, Literal)]
pub struct FirstFix {
    origin: Option<Geodetic>,
    position_sigma: [f64; 3],
    velocity_sigma: Option<[f64; 3]>,
    lever_arm: Vector3<f64>,
    /// The height for fixes without one.
    height: Option<f64>,
    median_of: usize,
    fixes: VecDeque<Fix>,
    /// From the fix before the latest one, per second \[m/s\].
    way: Vector3<f64>,
    velocity: Latest,
}

/// A position and its time.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Fix {
    time: Time,
    place: Geodetic,
}
memory!(Fix { time, place });

/// The latest velocity \[m/s\], its time, and the acceleration \[m/s²\] since the one before.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Latest {
    time: Time,
    value: Option<Vector3<f64>>,
    acceleration: Vector3<f64>,
}
memory!(Latest { time, value, acceleration });

impl Latest {
    fn hear(&mut self, time: Time, value: Vector3<f64>) {
        let dt = time.seconds_since(self.time);
        if let Some(before) = self.value.filter(|_| dt > 0.0) {
            self.acceleration = (value - before) / dt;
        }
        (self.time, self.value) = (time, Some(value));
    }

    /// 1σ per axis at `time`; `sigma` is the 1σ at the time of the measurement.
    fn sigma(&self, time: Time, sigma: &[f64; 3]) -> Vector3<f64> {
        let changed = self.acceleration * time.seconds_since(self.time);
        Vector3::from(*sigma).zip_map(&changed, math::hypot)
    }
}
memory!(FirstFix { fixes, way, velocity; origin, position_sigma, velocity_sigma, lever_arm, height, median_of });

impl FirstFix {
    /// From the body to the antenna, in navigation axes, and its variance.
    fn lever(&self, layout: &Layout, belief: &Belief) -> (Vector3<f64>, Vector3<f64>) {
        let l = &self.lever_arm;
        let most = l.norm_squared();
        let Some((q, p)) = known_attitude(layout, belief) else {
            return (Vector3::zeros(), Vector3::repeat(most));
        };
        let slope = so3::rotation(&q) * so3::skew(l);
        (q * l, (slope * p * slope.transpose()).diagonal().map(|v| v.min(most)))
    }

    /// The fix at `time`, and the growth of its 1σ.
    fn position(&self, time: Time) -> Option<(Geodetic, Vector3<f64>)> {
        let velocity = self.velocity.value.unwrap_or_default();
        let age = |fix: &Fix| time.seconds_since(fix.time);
        let carried = |fix: &Fix| fix.place.offset(&(velocity * age(fix)));
        let middle = |coordinate: fn(&Geodetic) -> f64| {
            let values: Vec<f64> = self.fixes.iter().map(|fix| coordinate(&carried(fix))).collect();
            math::middle(&values, f64::total_cmp)
        };
        let place = Geodetic {
            lat: middle(|g| g.lat)?,
            lon: middle(|g| g.lon)?,
            height: middle(|g| g.height)?,
        };
        let age = age(&self.fixes[self.fixes.len() / 2]);
        let grown = match &self.velocity_sigma {
            Some(sigma) => self.velocity.sigma(time, sigma) * age,
            // A median is for a vehicle at rest.
            None if self.median_of > 1 => Vector3::zeros(),
            None => self.way * age,
        };
        Some((place, grown))
    }
}

impl Initialiser for FirstFix {
    fn row(&mut self, input: usize, time: Time, row: &[f64]) {
        if input > 0 {
            self.velocity.hear(time, Vector3::new(row[0], row[1], row[2]));
            return;
        }
        let place = match (self.height, row) {
            (Some(height), [lat, lon, ..]) => Geodetic::new(*lat, *lon, height),
            _ => Geodetic::read(row),
        };
        if let Some(before) = self.fixes.back() {
            let dt = time.seconds_since(before.time);
            if dt > 0.0 {
                self.way = place.difference(&before.place) / dt;
            }
        }
        if self.fixes.len() == self.median_of {
            self.fixes.pop_front();
        }
        self.fixes.push_back(Fix { time, place });
    }

    fn waits_for(&self) -> Option<String> {
        if self.fixes.len() < self.median_of {
            return Some(if self.median_of == 1 {
                "a position fix".to_owned()
            } else {
                format!("{} position fixes", self.median_of)
            });
        }
        (self.velocity_sigma.is_some() && self.velocity.value.is_none()).then(|| "a velocity".to_owned())
    }

    fn write(&self, time: Time, layout: &Layout, belief: &mut Belief) {
        if let Some((antenna, grown)) = self.position(time) {
            let (lever, variance) = self.lever(layout, belief);
            let sigma: [f64; 3] =
                core::array::from_fn(|i| math::hypot(math::hypot(self.position_sigma[i], math::sqrt(variance[i])), grown[i]));
            write_position(layout, belief, self.origin, &antenna.offset(&-lever), &sigma);
        }
        if let (Some(v), Some(sigma)) = (&self.velocity.value, &self.velocity_sigma) {
            write_velocity(layout, belief, v, self.velocity.sigma(time, sigma).as_slice());
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, InitialiserSpec, Listen, Taken};
    use crate::de::DeserializeSpec;
    use crate::units::{Axes, Length, Vec3Of, dim, range};
    use crate::vocabulary::{channel, state};
    use core::num::NonZeroUsize;
    use schemars::JsonSchema;

    /// Position, and velocity where declared, from the latest fix before the filter starts.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct FirstFixSpec {
        /// A stream with a `position` channel, or with `horizontal_position` if the `height` is given.
        source: String,
        /// 1σ north, east, down of the initial position, if its errors are independent of the later fixes of a sensor.
        /// Without it, the fix is only a start position (100 m), and the next fixes determine the position. Leave it out if
        /// their sensor has a slow error, `bias`, because the first fix has it too.
        position_sigma: Option<Axes<dim::Length, range::NonNegative>>,
        /// Also uses the `velocity` channel, with this 1σ; without it another initialiser must give the velocity.
        velocity_sigma: Option<Axes<dim::Speed, range::NonNegative>>,
        /// Position of the antenna in body axes, from the body origin, as its sensor declares it.
        #[serde(default)]
        lever_arm: Vec3Of<dim::Length>,
        /// The height of the antenna above the ellipsoid, for fixes of the channel `horizontal_position`, which have no
        /// height.
        height: Option<Length>,
        /// The position is the median of this many latest fixes, axis by axis: for a vehicle at rest
        /// whose fixes contain outliers.
        #[serde(default = "one")]
        median_of: NonZeroUsize,
    }

    /// 1σ of a start position \[m\]: tens of times the errors of any fix, so that it has no effect after the next fix.
    const PLACE: f64 = 100.0;

    const fn one() -> NonZeroUsize {
        NonZeroUsize::MIN
    }

    crate::register!(
        Initialiser,
        "first_fix",
        FirstFixSpec,
        r#"
source = "gnss"
position_sigma = ["2 m", "2 m", "4 m"]
velocity_sigma = "0.3 m/s"
lever_arm = ["30 cm", 0, "-1 m"]
median_of = 1
"#
    );

    #[typetag::deserialize(name = "first_fix")]
    impl InitialiserSpec for FirstFixSpec {
        fn inputs(&self) -> Vec<Listen> {
            let listen = |channel| Listen {
                source: self.source.clone(),
                channels: vec![channel],
            };
            let fixes = if self.height.is_some() {
                channel::HORIZONTAL_POSITION
            } else {
                channel::POSITION
            };
            let mut inputs = vec![listen(fixes)];
            if self.velocity_sigma.is_some() {
                inputs.push(listen(channel::VELOCITY));
            }
            inputs
        }

        fn writes(&self) -> Vec<&'static str> {
            let mut blocks = vec![state::POSITION.as_str(), state::LOCAL_POSITION.as_str()];
            if self.velocity_sigma.is_some() {
                blocks.extend([state::VELOCITY.as_str(), state::SPEED.as_str()]);
            }
            blocks
        }

        fn takes(&self) -> Taken {
            self.position_sigma.map_or(Taken::Place, |sigma| Taken::Position(sigma.si()))
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError> {
            if self.position_sigma.is_none() && self.median_of != one() {
                let help = "add `position_sigma`, the 1σ of the median";
                return Err(BuildError::at("median_of", "a median has no effect if the next fix gives the position").help(help));
            }
            Ok(Box::new(FirstFix {
                origin: b.origin,
                position_sigma: self.position_sigma.map_or([PLACE; 3], Axes::si),
                velocity_sigma: self.velocity_sigma.map(Axes::si),
                lever_arm: self.lever_arm.si().into(),
                height: self.height.map(Length::si),
                median_of: self.median_of.get(),
                fixes: VecDeque::new(),
                way: Vector3::zeros(),
                velocity: Latest::default(),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, InitialiserSpec, Taken};
    use crate::vocabulary::state;
    use fusion_core::state::{Dynamics, Geodetic as Place, LayoutBuilder};
    use nalgebra::UnitQuaternion;

    #[test]
    fn the_median_of_the_latest_fixes_is_not_moved_by_an_outlier() {
        let origin = Geodetic {
            lat: 0.6,
            lon: 2.2,
            height: 10.0,
        };
        let mut f = FirstFix {
            origin: None,
            position_sigma: [1.0; 3],
            velocity_sigma: None,
            lever_arm: Vector3::zeros(),
            height: None,
            median_of: 3,
            fixes: VecDeque::new(),
            way: Vector3::zeros(),
            velocity: Latest::default(),
        };
        for (k, east) in [500.0, 0.1, 30.0, 0.2].into_iter().enumerate() {
            assert_eq!(f.waits_for().is_none(), k >= 3, "fix {k}");
            let mut row = [0.0; 3];
            Geodetic::write(&origin.offset(&Vector3::new(0.0, east, 0.0)), &mut row);
            f.row(0, Time::default(), &row);
        }
        let d = f.position(Time::default()).unwrap().0.difference(&origin);
        // Of 0.1, 30 and 0.2; 1e-6 m is the rounding of a longitude.
        assert!((d.y - 0.2).abs() < 1e-6, "{d}");
    }

    #[test]
    fn a_fix_is_carried_to_the_start_by_the_velocity_and_its_age_is_in_the_1_sigma() {
        let (origin, east) = (Geodetic::new(0.6, 2.2, 10.0), |e: f64| Vector3::new(0.0, e, 0.0));
        let fix = |velocity_sigma| FirstFix {
            origin: None,
            position_sigma: [1.0; 3],
            velocity_sigma,
            lever_arm: Vector3::zeros(),
            height: None,
            median_of: 1,
            fixes: VecDeque::new(),
            way: Vector3::zeros(),
            velocity: Latest::default(),
        };
        let at = Time::from_seconds;
        let hear = |f: &mut FirstFix, t: f64, e: f64| {
            let mut row = [0.0; 3];
            Geodetic::write(&origin.offset(&east(e)), &mut row);
            f.row(0, at(t), &row);
        };
        // 8 m/s, pulling away with 2 m/s²; the latest velocity is 0.4 s old, the fix 1 s.
        let mut f = fix(Some([0.3; 3]));
        hear(&mut f, 9.0, 0.0);
        f.row(1, at(8.6), &[0.0, 6.0, 0.0]);
        f.row(1, at(9.6), &[0.0, 8.0, 0.0]);
        let (place, grown) = f.position(at(10.0)).unwrap();
        // 1e-6 m: the rounding of a longitude.
        assert!((place.difference(&origin) - east(8.0)).norm() < 1e-6);
        let velocity = Vector3::new(0.3, 0.3_f64.hypot(0.4 * 2.0), 0.3);
        assert!((grown - velocity).norm() < 1e-12, "{grown}");
        // Without a velocity the position is kept, and the travelled way goes into its 1σ.
        let mut f = fix(None);
        hear(&mut f, 8.0, 0.0);
        hear(&mut f, 9.0, 7.0);
        let (place, grown) = f.position(at(9.5)).unwrap();
        assert!(
            (place.difference(&origin) - east(7.0)).norm() < 1e-6 && (grown - east(3.5)).norm() < 1e-6,
            "{grown}"
        );
    }

    /// Body position and its 1σ, from a fix at the origin, an antenna 2 m above and the attitude that `start`
    /// writes before.
    fn started(start: impl Fn(&Layout, &mut Belief)) -> (Vector3<f64>, Vector3<f64>) {
        let mut layout = LayoutBuilder::new();
        let origin = Geodetic::new(0.6, 2.2, 10.0);
        let mut b = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(origin),
            gravity: crate::earth::Gravity::default(),
        };
        let unset = || vec![0.0; 3];
        b.declare(state::POSITION, "m", origin, unset(), Dynamics::Process).unwrap();
        b.declare(state::ATTITUDE, "rad", UnitQuaternion::identity(), unset(), Dynamics::Process)
            .unwrap();
        let spec: FirstFixSpec = toml::from_str("source = 'gnss'\nposition_sigma = [3, 3, 4]\nlever_arm = [0, 0, -2]").unwrap();
        let mut fix = spec.build(&mut b).unwrap();
        let layout = layout.finish();
        let form = fusion_core::filter::Backend::default().form.form();
        let mut belief = Belief::initial(&layout, &form, Time::default());
        start(&layout, &mut belief);
        let mut row = [0.0; 3];
        Place::write(&origin, &mut row);
        fix.row(0, Time::default(), &row);
        fix.write(Time::default(), &layout, &mut belief);
        let block = layout.block(state::POSITION).unwrap();
        let place = Place::read(&belief.x[block.storage_range()]);
        let variance = belief.covariance.marginal::<3>(block).diagonal();
        (place.difference(&origin), variance.map(f64::sqrt))
    }

    #[test]
    fn without_a_sigma_it_is_a_place_to_begin_at() {
        let spec = |text: &str| toml::from_str::<FirstFixSpec>(&format!("source = 'gnss'\n{text}")).unwrap();
        assert_eq!(spec("").takes(), Taken::Place);
        assert_eq!(spec("position_sigma = [1, 2, 3]").takes(), Taken::Position([1.0, 2.0, 3.0]));
        let mut layout = LayoutBuilder::new();
        let mut b = Build {
            name: "fix",
            layout: &mut layout,
            origin: None,
            gravity: crate::earth::Gravity::default(),
        };
        assert!(spec("").build(&mut b).is_ok());
        assert_eq!(
            spec("median_of = 3").build(&mut b).map(|_| ()).map_err(|e| e.field),
            Err("median_of".to_owned())
        );
    }

    #[test]
    fn the_body_is_a_lever_arm_from_the_antenna_as_well_as_the_attitude_is_known() {
        use super::super::write_attitude;
        let q = so3::from_rpy(0.5, 0.0, 0.0);
        let (body, sigma) = started(|layout, belief| write_attitude(layout, belief, &q, &[0.1, 0.0, 3.0]));
        // Rolled to the right, the antenna is 2 sin 0.5 east of the body and 2 cos 0.5 above; 1e-8 m: longitude.
        assert!((body - Vector3::new(0.0, -0.958_851, 1.755_165)).amax() < 1e-6, "{body}");
        // A roll of 0.1 rad moves it by 0.2 m across, cos 0.5 of it east and sin 0.5 down; the yaw's 3 rad have no
        // effect, as the arm is along their axis.
        let expected = Vector3::new(3.0, 3.0_f64.hypot(0.2 * 0.5_f64.cos()), 4.0_f64.hypot(0.2 * 0.5_f64.sin()));
        assert!((sigma - expected).amax() < 1e-12, "{sigma}");
        // If no attitude is known, the body is somewhere around the antenna.
        let (body, sigma) = started(|_, _| {});
        assert!(body.norm() < 1e-8 && (sigma - Vector3::new(13.0_f64.sqrt(), 13.0_f64.sqrt(), 20.0_f64.sqrt())).amax() < 1e-12);
        // A tilt of half a turn gives the same limit.
        let (_, sigma) = started(|layout, belief| write_attitude(layout, belief, &q, &[3.0; 3]));
        assert!(sigma.y <= 13.0_f64.sqrt() + 1e-12, "{sigma}");
    }
}
