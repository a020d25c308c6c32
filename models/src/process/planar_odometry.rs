//! Odometry in the plane: speeds and rate of turn measured, position and heading estimated.
//!
//! Input      mean speed ahead u, speed to the right s \[m/s\] and yaw rate r \[rad/s\], clockwise, over
//!            a sample; without `sideways` s = 0
//! State      `local_position` p north, east, down of the origin \[m\], its down stands still; `heading`
//!            ψ \[rad\]
//! Signals    `position` (geodetic), `velocity`, `attitude` (level), `angular_rate`, `acceleration`
//! Model      ṗ = R(ψ) (u + w_u, s + w_s), ψ̇ = r + w_r
//! Discrete   exact on the arc of constant u, s, r: with x = rT/2 and R of the angle given,
//!            Δ = T sinc(x) R(ψ + x) (u, s), ψ⁺ = ψ + rT: group-affine on SE(2)
//! Φ          its exact derivative
//! Q          ∫ G N Gᵀ over the step, G what noise does in the rest of it; three nodes of Gauss
//! Valid      level ground, within some kilometres of the origin
//! Not here   scale and bias of the odometry, slip
//! Source     Barrau and Bonnabel 2017, §IV (the robot with wheel odometry)

use super::strapdown::discrete::GAUSS;
use super::unicycle::{arc, quarter};
use crate::earth::LocalFrame;
use crate::earth::frames::rotation_en;
use fusion_core::geometry::so3;
use fusion_core::linear::Transition;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::model::{Input, Literal, Order, Process, SignalsOut};
use fusion_core::state::{Angle, Attitude, Geodetic, Position, Signal, Slot, Vector, Velocity, wrap};
use nalgebra::{Matrix1, Matrix2, Matrix3, Vector2, Vector3};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct PlanarOdometry {
    position: Slot<Position>,
    heading: Slot<Angle>,
    geodetic: Signal<Geodetic>,
    velocity: Signal<Velocity>,
    attitude: Signal<Attitude>,
    angular_rate: Signal<Vector<3>>,
    acceleration: Signal<Vector<3>>,
    speed_psd: Vector2<f64>,
    yaw_rate_psd: f64,
    sideways: bool,
    frame: LocalFrame,
    /// Local axes at the origin to Earth-centred axes.
    c_en: Matrix3<f64>,
}

/// R(ψ): ahead and right to north and east.
fn rotation(psi: f64) -> Matrix2<f64> {
    let (sin, cos) = math::sin_cos(psi);
    Matrix2::new(cos, -sin, sin, cos)
}

impl PlanarOdometry {
    /// The speed ahead and to the right \[m/s\], the yaw rate \[rad/s\].
    fn rates(&self, input: &Input<'_>) -> (Vector2<f64>, f64) {
        match (self.sideways, input.sample) {
            (true, [u, s, r, ..]) => (Vector2::new(*u, *s), *r),
            (false, [u, r, ..]) => (Vector2::new(*u, 0.0), *r),
            _ => (Vector2::zeros(), 0.0),
        }
    }
}

/// The displacement \[m\] over `dt` \[s\] from heading `psi` \[rad\], by `speed` \[m/s\] in body axes
/// and yaw rate `r` \[rad/s\].
fn displacement(psi: f64, speed: &Vector2<f64>, r: f64, dt: f64) -> Vector2<f64> {
    let ahead = arc(psi, 1.0, r, dt).moved;
    ahead * speed.x + quarter(&ahead) * speed.y
}

impl Process for PlanarOdometry {
    fn input_dim(&self) -> usize {
        if self.sideways { 3 } else { 2 }
    }

    fn order(&self) -> Order {
        Order::Exact
    }

    fn propagate(&self, x: &mut [f64], input: &Input<'_>, dt: f64) {
        let (speed, r) = self.rates(input);
        let psi = self.heading.read(x);
        let moved = displacement(psi, &speed, r, dt).push(0.0);
        self.position.write(&(self.position.read(x) + moved), x);
        self.heading.write(&wrap(psi + r * dt), x);
    }

    fn linearise(&self, x: &[f64], input: &Input<'_>, dt: f64, out: &mut Transition) {
        let (speed, r) = self.rates(input);
        let psi = self.heading.read(x);
        let turned = quarter(&displacement(psi, &speed, r, dt));
        out.set(self.position, self.heading, &turned.push(0.0));
        let (mut pp, mut ph) = (Matrix2::zeros(), Vector2::zeros());
        for (node, weight) in GAUSS {
            // Noise that acts when `rest` seconds of the step are left.
            let (rest, share) = (node * dt, weight * dt);
            let now = psi + r * (dt - rest);
            let c = rotation(now);
            let by_turn = quarter(&displacement(now, &speed, r, rest));
            pp += (c * Matrix2::from_diagonal(&self.speed_psd) * c.transpose() + by_turn * by_turn.transpose() * self.yaw_rate_psd) * share;
            ph += by_turn * (self.yaw_rate_psd * share);
        }
        out.noise(self.position, self.position, &pp.fixed_resize::<3, 3>(0.0));
        out.noise(self.position, self.heading, &ph.push(0.0));
        out.noise(self.heading, self.heading, &Matrix1::new(self.yaw_rate_psd * dt));
    }

    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        let (speed, r) = self.rates(input);
        let psi = self.heading.read(x);
        let position = self.frame.to_geodetic(&self.position.read(x));
        let v = rotation(psi) * speed;
        let across = quarter(&v);
        out.set(self.geodetic, &position);
        out.set(self.velocity, &v.push(0.0));
        out.set(self.attitude, &so3::from_rpy(0.0, 0.0, psi));
        out.set(self.angular_rate, &Vector3::new(0.0, 0.0, r));
        out.set(self.acceleration, &(across * r).push(0.0));
        if out.wants_jacobian() {
            // From the axes at the origin to those at the position.
            let turn = rotation_en(position.lat, position.lon).transpose() * self.c_en;
            out.add(self.geodetic, self.position, &turn);
            out.add(self.velocity, self.heading, &across.push(0.0));
            out.add(self.attitude, self.heading, &Vector3::z());
            out.add(self.acceleration, self.heading, &(v * -r).push(0.0));
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
    use crate::earth::{Gravity, LocalEarth};
    use crate::units::{NonNegative, dim};
    use crate::vocabulary::{channel, state};
    use fusion_core::state::Dynamics;
    use schemars::JsonSchema;

    /// Odometry in the plane: a robot whose speeds and rate of turn are measured. Driven by the channels
    /// `forward_speed`, `sideways_speed` and `yaw_rate` of its source. Needs an origin.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct PlanarOdometrySpec {
        /// White noise density of the speed ahead; 1σ of a sample over the root of the rate of samples.
        forward_noise: NonNegative<dim::PositionRandomWalk>,
        /// White noise density of the speed to the right.
        sideways_noise: NonNegative<dim::PositionRandomWalk>,
        /// White noise density of the yaw rate.
        yaw_rate_noise: NonNegative<dim::AngleRandomWalk>,
        /// Whether the speed to the right is measured too; otherwise it is 0 but for its noise.
        #[serde(default = "yes")]
        sideways: bool,
    }

    const fn yes() -> bool {
        true
    }

    crate::register!(
        Process,
        "planar_odometry",
        PlanarOdometrySpec,
        r#"
forward_noise = "1 mm/sqrt(s)"
sideways_noise = "2 mm/sqrt(s)"
yaw_rate_noise = "0.1 deg/sqrt(s)"
sideways = true
"#
    );

    #[typetag::deserialize(name = "planar_odometry")]
    impl ProcessSpec for PlanarOdometrySpec {
        fn input(&self) -> Vec<Channel> {
            let sideways = self.sideways.then_some(channel::SIDEWAYS_SPEED);
            [channel::FORWARD_SPEED]
                .into_iter()
                .chain(sideways)
                .chain([channel::YAW_RATE])
                .collect()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError> {
            let origin = b.origin()?;
            let frame = LocalFrame::new(origin);
            b.gravity = Gravity::Flat(LocalEarth::at(&origin).gravity(b.gravity));
            let square = |density: f64| density * density;
            let (position, heading) = (vec![0.0; 3], vec![0.0]);
            Ok(Box::new(PlanarOdometry {
                position: b.declare(state::LOCAL_POSITION, "m", Vector3::zeros(), position, Dynamics::Process)?,
                heading: b.declare(state::HEADING, "rad", 0.0, heading, Dynamics::Process)?,
                geodetic: b.signal(state::POSITION)?,
                velocity: b.signal(state::VELOCITY)?,
                attitude: b.signal(state::ATTITUDE)?,
                angular_rate: b.signal(state::ANGULAR_RATE)?,
                acceleration: b.signal(state::ACCELERATION)?,
                speed_psd: Vector2::new(square(self.forward_noise.si()), square(self.sideways_noise.si())),
                yaw_rate_psd: square(self.yaw_rate_noise.si()),
                sideways: self.sideways,
                c_en: rotation_en(origin.lat, origin.lon),
                frame,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, ProcessSpec};
    use crate::earth::Gravity;

    #[test]
    fn sideways_on_a_circle_is_a_circle_about_another_centre() {
        let (r, quarter_turn) = (0.5, core::f64::consts::PI);
        let moved = displacement(0.0, &Vector2::new(0.0, 2.0), r, quarter_turn);
        // To the right at 2 m/s, turning right: radius 4 m about a point 4 m behind.
        assert!((moved - Vector2::new(-4.0, 4.0)).amax() < 1e-14, "{moved}"); // 4 ε of 4
    }

    #[test]
    fn noise_of_one_step_is_that_of_many() {
        let (speed, r, dt) = (Vector2::new(3.0, 0.5), 2.0, 0.1);
        let spec: PlanarOdometrySpec = toml::from_str("forward_noise = 0.1\nsideways_noise = 0.3\nyaw_rate_noise = 0.2").unwrap();
        let mut layout = fusion_core::state::LayoutBuilder::new();
        let mut build = Build {
            name: "process",
            layout: &mut layout,
            origin: Some(Geodetic::new(0.6, 2.2, 0.0)),
            gravity: Gravity::default(),
        };
        let (process, sample) = (spec.build(&mut build).unwrap(), [speed.x, speed.y, r]);
        let layout = layout.finish();
        let q = |steps: u32| {
            let (mut x, mut q) = (layout.initial().to_vec(), nalgebra::Matrix4::zeros());
            for _ in 0..steps {
                let mut t = Transition::new(&layout);
                process.linearise(&x, &Input::held(&sample), dt / f64::from(steps), &mut t);
                let phi = nalgebra::Matrix4::from_fn(|i, j| t.phi.get(i, j));
                q = phi * q * phi.transpose();
                t.noise_after().for_each(|(i, j, v)| q[(i, j)] += v);
                process.propagate(&mut x, &Input::held(&sample), dt / f64::from(steps));
            }
            q
        };
        let (one, many) = (q(1), q(50));
        // 1e-6: (2rΔt)⁶/7!·… of three nodes, at 23° of turn.
        assert!((one - many).amax() < 1e-6 * many.amax(), "{one} {many}");
    }
}
