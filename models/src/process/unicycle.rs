//! Unicycle: a vehicle that drives ahead and turns, in the horizontal plane.
//!
//! State      position (geodetic; its height stands still), heading ψ \[rad\], speed u \[m/s\],
//!            yaw rate r \[rad/s\]; where estimated the side slip σ \[s\]
//! Model      ṗ = u [cos ψ, sin ψ] − σ u r [−sin ψ, cos ψ], ψ̇ = r + w_ψ, u̇ = w_u, ṙ = w_r
//! Slip       a vehicle that skids slides out of its turn: friction that grows with the speed of sliding
//!            balances the centripetal acceleration u r, so that it slides at σ u r
//! Discrete   exact on the arc of constant u and r: with x = rT/2, J a quarter turn clockwise,
//!            Δ = (1 − σ r J) u T sinc(x) [cos(ψ + x), sin(ψ + x)], ψ⁺ = ψ + rT
//!            Φ its exact derivative, in the charts of the positions before and after
//!            Q trapezoidal, ½(ΦQ_cΦᵀ + Q_c)T
//! Signals    velocity (north east down), attitude (level), angular_rate (body, of turning),
//!            acceleration (dv/dt, north east down)
//! Valid      no slopes; the Earth's rotation is left out of angular_rate

use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::{Radii, divisible_cos, radii, radii_derivative};
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::model::{Input, Literal, Process, SignalsOut};
use fusion_core::state::{Angle, Attitude, Geodetic, Param, Scalar, Signal, Slot, Vector, Velocity, wrap};
use nalgebra::{Matrix1, Matrix3, Vector2, Vector3};

/// sin(x)/x and its derivative.
fn sinc(x: f64) -> (f64, f64) {
    let y = x * x;
    if y < 1e-4 {
        // The next terms are y³/5040 = 2e-16 and x y²·6/5040 = 1e-13 of x.
        (1.0 - y / 6.0 * (1.0 - y / 20.0), -x / 3.0 * (1.0 - y / 10.0 * (1.0 - y / 28.0)))
    } else {
        let (s, c) = math::sin_cos(x);
        (s / x, (c - s / x) / x)
    }
}

/// An arc of constant speed and rate: the displacement north and east \[m\] and its derivatives.
pub(super) struct Arc {
    pub(super) moved: Vector2<f64>,
    by_heading: Vector2<f64>,
    by_speed: Vector2<f64>,
    by_rate: Vector2<f64>,
}

/// The arc from heading `psi` \[rad\] at speed `u` \[m/s\] and rate `r` \[rad/s\] over `dt` \[s\].
pub(super) fn arc(psi: f64, u: f64, r: f64, dt: f64) -> Arc {
    let x = 0.5 * r * dt;
    let (chord, slope) = sinc(x);
    let (sin, cos) = math::sin_cos(psi + x);
    let (ahead, across) = (Vector2::new(cos, sin), Vector2::new(-sin, cos));
    Arc {
        moved: ahead * (u * dt * chord),
        by_heading: across * (u * dt * chord),
        by_speed: ahead * (dt * chord),
        by_rate: (ahead * slope + across * chord) * (0.5 * u * dt * dt),
    }
}

/// ∂(p⁺ ⊟ p̂⁺)/∂(p ⊟ p̂) for p⁺ = p ⊞ Δ with Δ = `moved` \[m\] held, and the factors on ∂Δ: the
/// metres per radian at p⁺ over those at p.
pub(super) fn carried(p: &Geodetic, after: &Geodetic, moved: &Vector2<f64>) -> (Matrix3<f64>, Vector2<f64>) {
    let Radii { meridian, normal } = radii(p.lat);
    let slope = radii_derivative(p.lat);
    let (sin, cos) = math::sin_cos(p.lat);
    let cos = divisible_cos(cos);
    let (rm, rn) = (meridian + p.height, normal + p.height);
    let (north, east) = after.metres_per_radian();
    let factor = Vector2::new(north / rm, east / (rn * cos));
    // Δλ = δE/((RN + h) cos φ) − Δ_E δ((RN + h) cos φ)/((RN + h) cos φ)², and so for latitude;
    // δφ = δN/(RM + h), δh = −δD.
    let (n, e) = (moved.x / rm, moved.y / rn);
    let tan = sin / cos;
    #[rustfmt::skip]
    let carried = Matrix3::new(
        factor.x * (1.0 - n * slope.meridian / rm), 0.0, factor.x * n,
        -factor.y * e * (slope.normal - rn * tan) / rm, factor.y, factor.y * e,
        0.0, 0.0, 1.0,
    );
    (carried, factor)
}

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Unicycle {
    position: Slot<Geodetic>,
    heading: Slot<Angle>,
    speed: Slot<Scalar>,
    yaw_rate: Slot<Scalar>,
    side_slip: Param<Scalar>,
    velocity: Signal<Velocity>,
    attitude: Signal<Attitude>,
    angular_rate: Signal<Vector<3>>,
    acceleration: Signal<Vector<3>>,
    position_psd: Vector3<f64>,
    heading_psd: f64,
    speed_psd: f64,
    yaw_rate_psd: f64,
    max_step: f64,
}

/// A quarter turn clockwise, J: ∂R/∂ψ = R J.
pub(super) fn quarter(v: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-v.y, v.x)
}

impl Unicycle {
    fn slip(&self, x: &[f64]) -> f64 {
        self.side_slip.stored(x).unwrap_or_default()
    }

    /// The displacement and its derivatives, what the vehicle slides sideways included; the derivative by the
    /// side slip.
    fn arc(&self, x: &[f64], dt: f64) -> (Arc, Vector2<f64>) {
        let (r, slip) = (self.yaw_rate.read(x), self.slip(x));
        let rolling = arc(self.heading.read(x), self.speed.read(x), r, dt);
        let sliding = |v: &Vector2<f64>| v - quarter(v) * (slip * r);
        let across = quarter(&rolling.moved);
        let slipping = Arc {
            moved: sliding(&rolling.moved),
            by_heading: sliding(&rolling.by_heading),
            by_speed: sliding(&rolling.by_speed),
            by_rate: sliding(&rolling.by_rate) - across * slip,
        };
        (slipping, across * -r)
    }
}

impl Process for Unicycle {
    fn input_dim(&self) -> usize {
        0
    }

    fn max_step(&self) -> f64 {
        self.max_step
    }

    fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
        let moved = self.arc(x, dt).0.moved;
        self.position.write(&self.position.read(x).offset(&moved.push(0.0)), x);
        self.heading.write(&wrap(self.heading.read(x) + self.yaw_rate.read(x) * dt), x);
    }

    fn linearise(&self, x: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        let (arc, by_slip) = self.arc(x, dt);
        let position = self.position.read(x);
        let (carried, factor) = carried(&position, &position.offset(&arc.moved.push(0.0)), &arc.moved);
        let metres = |d: Vector2<f64>| d.component_mul(&factor).push(0.0);
        out.set(self.position, self.position, &carried);
        out.set(self.position, self.heading, &metres(arc.by_heading));
        out.set(self.position, self.speed, &metres(arc.by_speed));
        out.set(self.position, self.yaw_rate, &metres(arc.by_rate));
        if let Param::State(slip) = self.side_slip {
            out.set(self.position, slip, &metres(by_slip));
        }
        out.set(self.heading, self.yaw_rate, &Matrix1::new(dt));
        out.noise_trapezoid(self.position, self.position, &Matrix3::from_diagonal(&(self.position_psd * dt)));
        out.noise_trapezoid(self.heading, self.heading, &Matrix1::new(self.heading_psd * dt));
        out.noise_trapezoid(self.speed, self.speed, &Matrix1::new(self.speed_psd * dt));
        out.noise_trapezoid(self.yaw_rate, self.yaw_rate, &Matrix1::new(self.yaw_rate_psd * dt));
    }

    fn signals(&self, x: &[f64], _: &Input<'_>, out: &mut SignalsOut<'_>) {
        let (psi, u, r) = (self.heading.read(x), self.speed.read(x), self.yaw_rate.read(x));
        let (sin, cos) = math::sin_cos(psi);
        let (ahead, across) = (Vector3::new(cos, sin, 0.0), Vector3::new(-sin, cos, 0.0));
        let slip = self.slip(x);
        // The way it goes at a speed of one, and that way turned right by a quarter.
        let (way, aside) = (ahead - across * (slip * r), across + ahead * (slip * r));
        out.set(self.velocity, &(way * u));
        out.set(self.attitude, &so3::from_rpy(0.0, 0.0, psi));
        out.set(self.angular_rate, &Vector3::new(0.0, 0.0, r));
        out.set(self.acceleration, &(aside * (u * r)));
        if out.wants_jacobian() {
            out.add(self.velocity, self.heading, &(aside * u));
            out.add(self.velocity, self.speed, &way);
            out.add(self.velocity, self.yaw_rate, &(across * (-slip * u)));
            out.add_quantity(self.velocity, &self.side_slip, &(across * (-u * r)));
            out.add(self.attitude, self.heading, &Vector3::z());
            out.add(self.angular_rate, self.yaw_rate, &Vector3::z());
            out.add(self.acceleration, self.heading, &(way * (-u * r)));
            out.add(self.acceleration, self.speed, &(aside * r));
            out.add(self.acceleration, self.yaw_rate, &(aside * u + ahead * (slip * u * r)));
            out.add_quantity(self.acceleration, &self.side_slip, &(ahead * (u * r * r)));
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, ProcessSpec};
    use crate::de::DeserializeSpec;
    use crate::param::ScalarParam;
    use crate::units::{self, Axes, Duration, NonNegative, Positive, dim, range};
    use crate::vocabulary::state;
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// A vehicle that drives ahead and turns, in the horizontal plane; no input.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct UnicycleSpec {
        /// White noise density of the acceleration ahead.
        speed_noise: NonNegative<dim::VelocityRandomWalk>,
        /// White noise density of the yaw acceleration.
        yaw_rate_noise: NonNegative<dim::RateRandomWalk>,
        /// Random walk of the heading: rotation that the yaw rate does not contain.
        #[serde(default)]
        heading_noise: NonNegative<dim::AngleRandomWalk>,
        /// Random walk of the position, north east down: slip, and changes of height.
        #[serde(default = "still")]
        position_noise: Axes<dim::PositionRandomWalk, range::NonNegative>,
        /// Initial 1σ of position, north east down; it starts at the origin, or at the position that an
        /// initialiser gives.
        position_sigma: Axes<dim::Length, range::NonNegative>,
        /// Heading the filter starts from, clockwise from north.
        #[serde(default)]
        initial_heading: units::Angle,
        /// Initial 1σ of heading.
        heading_sigma: NonNegative<dim::Angle>,
        /// Speed the filter starts from.
        #[serde(default)]
        initial_speed: units::Speed,
        /// Initial 1σ of speed.
        speed_sigma: NonNegative<dim::Speed>,
        /// Initial 1σ of the yaw rate, which starts from zero.
        yaw_rate_sigma: NonNegative<dim::AngularRate>,
        /// How a vehicle that skids slides out of its turn: the speed sideways over speed times yaw rate; 0.3 s for
        /// a skid-steered one of half a ton. Estimated as the state `side_slip`.
        #[serde(default)]
        side_slip: ScalarParam<dim::Duration>,
        /// The longest step that one linearisation covers.
        #[serde(default = "tenth")]
        max_step: Positive<dim::Duration>,
    }

    fn still() -> Axes<dim::PositionRandomWalk, range::NonNegative> {
        [NonNegative::default(); 3].into()
    }

    fn tenth() -> Positive<dim::Duration> {
        #[expect(clippy::unwrap_used, reason = "a constant greater than 0")]
        Positive::try_from_si(Duration::from_si(0.1).si()).unwrap()
    }

    crate::register!(
        Process,
        "unicycle",
        UnicycleSpec,
        r#"
speed_noise = "0.3 m/s^2/sqrt(Hz)"
yaw_rate_noise = "5 deg/s^2/sqrt(Hz)"
heading_noise = "0.1 deg/sqrt(s)"
position_noise = ["1 cm/sqrt(s)", "1 cm/sqrt(s)", "1 mm/sqrt(s)"]
position_sigma = "10 m"
initial_heading = "30 deg"
heading_sigma = "10 deg"
initial_speed = "1 m/s"
speed_sigma = "1 m/s"
yaw_rate_sigma = "5 deg/s"
side_slip = { estimate = true, initial = "0.2 s", sigma = "0.2 s" }
max_step = "0.1 s"
"#
    );

    #[typetag::deserialize(name = "unicycle")]
    impl ProcessSpec for UnicycleSpec {
        fn input(&self) -> Vec<Channel> {
            Vec::new()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let origin = b.origin.unwrap_or(Geodetic::new(0.0, 0.0, 0.0));
            let psd = |density: f64| density * density;
            let heading = wrap(self.initial_heading.si());
            Ok(Box::new(Unicycle {
                position: b.declare(state::POSITION, "m", origin, self.position_sigma.si().to_vec(), Dynamics::Process)?,
                heading: b.declare(state::HEADING, "rad", heading, vec![self.heading_sigma.si()], Dynamics::Process)?,
                speed: b.declare(
                    state::SPEED,
                    "m/s",
                    self.initial_speed.si(),
                    vec![self.speed_sigma.si()],
                    Dynamics::Process,
                )?,
                yaw_rate: b.declare(state::YAW_RATE, "rad/s", 0.0, vec![self.yaw_rate_sigma.si()], Dynamics::Process)?,
                side_slip: b.param_named(state::SIDE_SLIP, "side_slip", &self.side_slip)?,
                velocity: b.signal(state::VELOCITY)?,
                attitude: b.signal(state::ATTITUDE)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                acceleration: b.signal(state::ACCELERATION)?,
                position_psd: Vector3::from(self.position_noise.si()).map(psd),
                heading_psd: psd(self.heading_noise.si()),
                speed_psd: psd(self.speed_noise.si()),
                yaw_rate_psd: psd(self.yaw_rate_noise.si()),
                max_step: self.max_step.si(),
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};

    #[test]
    fn a_full_circle_closes_and_half_of_one_is_a_diameter_across() {
        let (u, r) = (2.0, 0.1);
        let turn = core::f64::consts::TAU / r;
        // 10 ε of a path of 126 m.
        assert!(arc(0.3, u, r, turn).moved.amax() < 1e-13);
        let half = arc(0.0, u, r, 0.5 * turn).moved;
        assert!((half - Vector2::new(0.0, 2.0 * u / r)).amax() < 1e-13, "{half}");
    }

    #[test]
    fn both_branches_of_sinc_agree_where_they_meet() {
        let (below, above) = (sinc(0.01 - 1e-12), sinc(0.01 + 1e-12));
        // 1e-12: the gap itself times a slope of 1/3, and ε/x of rounding.
        assert!((below.0 - above.0).abs() < 1e-13 && (below.1 - above.1).abs() < 2e-12);
    }

    #[test]
    fn the_slopes_of_an_arc_match_central_differences() {
        let (psi, u, r, dt, h) = (0.4, 3.0, -0.8, 2.0, 1e-5);
        let a = arc(psi, u, r, dt);
        for (slope, [dp, du, dr]) in [
            (a.by_heading, [h, 0.0, 0.0]),
            (a.by_speed, [0.0, h, 0.0]),
            (a.by_rate, [0.0, 0.0, h]),
        ] {
            let numeric = (arc(psi + dp, u + du, r + dr, dt).moved - arc(psi - dp, u - du, r - dr, dt).moved) / (2.0 * h);
            // 1e-9: h²/6·f''' with f''' of up to 12, rounding 1e-15/h.
            assert!((slope - numeric).amax() < 1e-9, "{slope} {numeric}");
        }
    }

    #[test]
    fn a_displacement_carries_errors_of_position_as_central_differences_say() {
        let (p, moved) = (Geodetic::new(1.1, 2.0, 500.0), Vector2::new(4e4, -3e4));
        let after = p.offset(&moved.push(0.0));
        let (carried, factor) = carried(&p, &after, &moved);
        for k in 0..3 {
            let mut d = Vector3::zeros();
            d[k] = 100.0;
            let end = |d: Vector3<f64>| p.offset(&d).offset(&moved.push(0.0)).difference(&after);
            let numeric = (end(d) - end(-d)) / 200.0;
            // 1e-8: (100 m/R)² of curvature, and rounding 4e-9 m over 200 m.
            assert!((carried.column(k) - numeric).amax() < 1e-8, "{k}: {} {numeric}", carried.column(k));
        }
        let further = p.offset(&(moved + Vector2::new(0.0, 100.0)).push(0.0)).difference(&after);
        assert!((further.y - 100.0 * factor.y).abs() < 1e-6 && factor.y < 0.99); // meridians converge
    }

    #[test]
    fn a_vehicle_that_skids_is_further_out_after_half_a_circle_and_where_it_would_be_after_a_whole_one() {
        let text = "speed_noise = 1\nyaw_rate_noise = 1\nposition_sigma = 1\nheading_sigma = 1\nspeed_sigma = 1\nyaw_rate_sigma = 1";
        let spec: UnicycleSpec = toml::from_str(&format!("{text}\nside_slip = 0.3")).unwrap();
        let mut layout = fusion_core::state::LayoutBuilder::new();
        let place = Geodetic::new(0.6, 2.2, 0.0);
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(place),
            gravity: crate::earth::Gravity::default(),
        };
        let process = spec.build(&mut build).unwrap();
        let (u, r) = (2.0, 0.5);
        let after = |dt: f64| {
            let mut x = layout.so_far().initial().to_vec();
            x[4..6].copy_from_slice(&[u, r]);
            process.propagate(&mut x, &Input::held(&[]), dt);
            Geodetic::new(x[0], x[1], x[2]).difference(&place)
        };
        let half = core::f64::consts::PI / r;
        // The integral of −σ u r [−sin, cos] over half a circle is 2 σ u north. 1e-5: 8 m squared over the radius of
        // the Earth; 1e-8: coordinates of 6e6 m.
        let moved = after(half);
        assert!((moved - Vector3::new(2.0 * 0.3 * u, 2.0 * u / r, 0.0)).amax() < 1e-5, "{moved}");
        assert!(after(2.0 * half).amax() < 1e-8);
    }

    #[test]
    fn many_short_arcs_are_one_long_arc() {
        let (mut at, mut psi) = (Vector2::zeros(), 0.7);
        for _ in 0..100 {
            at += arc(psi, 3.0, -0.4, 0.05).moved;
            psi += -0.4 * 0.05;
        }
        // 100 roundings of 15 m.
        assert!((at - arc(0.7, 3.0, -0.4, 5.0).moved).amax() < 1e-13);
    }
}
