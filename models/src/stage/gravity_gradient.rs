//! A gradient step towards the vertical as a measured attitude, as a paper prints it.
//!
//! Output     `attitude` q_∇;  `attitude_sigma` and `tilt_sigma` σ √(1 + k (|f|/g − 1)²) \[rad\]
//! Gravity    at rest f_b/|f| = −g_b(q),  g_b = C_nbᵀ e₃ = [2(q1q3 − q0q2), 2(q0q1 + q2q3), 1 − 2(q1² + q2²)]
//!            F(q) = g_b + f_b/|f|,  J = ∂F/∂q,  ∇ = JᵀF
//! Step       q_∇ = q − μ ∇/|∇|,  μ = α |q̇_ω| Δt + μ₀,  |q̇_ω| = ½|w|: turns the tilt by 2μ rad for
//!            any tilt; it ends in a limit cycle of that size
//! From       `last` the estimate before the last time step, as printed: the prediction turned back
//!            by w Δt; the measured attitude then lags by a sample. `predicted` the prediction
//! Rate       w = w_m minus the filter's own `gyro_bias`
//! Used by    the sensor `attitude`: `part = "tilt"`, which is correct, or `part = "all"`, which is H = I₄
//!            with a scalar R as printed. The filter then uses its own heading as a measurement, so that its
//!            σ is too small and a compass has almost no effect
//! Valid      at rest or in steady motion: rows with ||f| − g| > `band`·g are left out
//! Source     Madgwick 2010, eqs. 12-34, with gravity along down

use fusion_core::geometry::so3;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Attitude, Quantity, Vector, View};
use fusion_core::time::Time;
use nalgebra::{Matrix3x4, UnitQuaternion, Vector3};

/// The gradient below which the step has no direction: tilt of 1e-9 rad.
const FLAT: f64 = 4e-9;

/// F(q): how far the direction of `f_b` is from straight up.
#[inline]
#[must_use]
pub fn gravity_error(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>) -> Vector3<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    let g_b = Vector3::new(2.0 * (x * z - w * y), 2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
    g_b + f_b / f_b.norm()
}

/// J = ∂F/∂q, scalar first.
#[inline]
#[must_use]
pub fn gravity_jacobian(q: &UnitQuaternion<f64>) -> Matrix3x4<f64> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    #[rustfmt::skip]
    let j = Matrix3x4::new(
        -2.0 * y, 2.0 * z, -2.0 * w, 2.0 * x,
        2.0 * x, 2.0 * w, 2.0 * z, 2.0 * y,
        0.0, -4.0 * x, -4.0 * y, 0.0,
    );
    j
}

/// μ: the length of a gradient step at the rate `w_nb_b` \[rad/s\] over `dt` \[s\].
#[inline]
#[must_use]
pub fn step_length(alpha: f64, floor: f64, w_nb_b: &Vector3<f64>, dt: f64) -> f64 {
    alpha * 0.5 * w_nb_b.norm() * dt + floor
}

/// One gradient step of length `mu` from `q` towards a vertical `f_b` (any length); `None` if the gradient vanishes or
/// has no direction.
#[inline]
#[must_use]
pub fn gradient_step(q: &UnitQuaternion<f64>, f_b: &Vector3<f64>, mu: f64) -> Option<UnitQuaternion<f64>> {
    let gradient = gravity_jacobian(q).transpose() * gravity_error(q, f_b);
    let length = gradient.norm();
    // NaN also fails.
    (length > FLAT).then(|| so3::from_scalar_first(&(so3::to_scalar_first(q) - gradient * (mu / length))))
}

/// Where a gradient step starts.
#[derive(Clone, Copy, Debug, Default, Literal, PartialEq, Eq)]
#[cfg_attr(
    feature = "declare",
    derive(serde::Deserialize, schemars::JsonSchema),
    serde(rename_all = "snake_case")
)]
pub enum StepFrom {
    /// The last estimate, as a paper prints it: the measured attitude lags by one sample.
    #[default]
    Last,
    /// The prediction.
    Predicted,
}

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct GravityGradient {
    attitude: Quantity<Attitude>,
    gyro_bias: Option<Quantity<Vector<3>>>,
    gain: f64,
    floor: f64,
    from: StepFrom,
    sigma: f64,
    adaptive: f64,
    band: f64,
    gravity: f64,
    last: Option<Time>,
}
memory!(GravityGradient { last; attitude, gyro_bias, gain, floor, from, sigma, adaptive, band, gravity });

impl Stage for GravityGradient {
    fn row(&mut self, _: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        if !row.iter().all(|v| v.is_finite()) {
            return;
        }
        let dt = self.last.map_or(0.0, |last| time.seconds_since(last));
        self.last = Some(time);
        let Some(view) = view else { return };
        let (w_m, f) = (Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
        let w = w_m - self.gyro_bias.as_ref().map_or_else(Vector3::zeros, |bias| view.get(bias));
        let excess = f.norm() / self.gravity - 1.0;
        if excess.abs() > self.band {
            return;
        }
        let predicted = view.get(&self.attitude);
        let from = match self.from {
            StepFrom::Last => predicted * so3::exp(&(w * -dt)),
            StepFrom::Predicted => predicted,
        };
        if let Some(q) = gradient_step(&from, &f, step_length(self.gain, self.floor, &w, dt)) {
            let sigma = self.sigma * math::sqrt(1.0 + self.adaptive * excess * excess);
            out.emit(time, &[q.w, q.i, q.j, q.k, sigma, sigma, sigma, sigma, sigma]);
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec, imu_channels};
    use crate::de::DeserializeSpec;
    use crate::earth::LocalEarth;
    use crate::units::{Dimensional, NonNegative, Positive, Quantity as Unit, Range, STANDARD_GRAVITY, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// A gradient step from the estimate towards the vertical of the accelerometers, as a measured attitude.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct GravityGradientSpec {
        /// The IMU stream.
        source: String,
        /// α, the step in units of the rotation measured by the gyros.
        #[serde(default = "gain")]
        gain: NonNegative<dim::Ratio>,
        /// μ₀, the step at rest: half the tilt that one sample corrects. The limit cycle is twice this step.
        #[serde(default = "floor")]
        floor: Positive<dim::Ratio>,
        /// Where the step starts.
        #[serde(default)]
        from: StepFrom,
        /// 1σ of the measured attitude about each axis: twice the 1σ of a component of the quaternion.
        #[serde(default = "sigma")]
        sigma: Positive<dim::Angle>,
        /// k of σ² (1 + k (|f|/g − 1)²); 0 is a constant σ.
        #[serde(default)]
        adaptive: NonNegative<dim::Ratio>,
        /// Samples are left out where |f| differs from g by more than this share of g.
        #[serde(default = "band")]
        band: Positive<dim::Ratio>,
        /// g; by default the gravity at the origin, or standard gravity.
        gravity: Option<Positive<dim::Acceleration>>,
    }

    /// A default within its range.
    fn constant<D: Dimensional, R: Range>(value: f64) -> Unit<D, R> {
        Unit::try_from_si(value).unwrap_or_else(|_| unreachable!("the default {value} is in range"))
    }

    fn gain() -> NonNegative<dim::Ratio> {
        constant(1.5)
    }

    fn floor() -> Positive<dim::Ratio> {
        constant(1e-4)
    }

    fn sigma() -> Positive<dim::Angle> {
        constant(4e-3)
    }

    fn band() -> Positive<dim::Ratio> {
        constant(0.05)
    }

    crate::register!(
        Stage,
        "gravity_gradient",
        GravityGradientSpec,
        r#"
source = "imu"
gain = 1.5
floor = 1e-4
from = "predicted"
sigma = "0.25 deg"
adaptive = 10
band = "5 %"
gravity = "9.81 m/s^2"
"#
    );

    #[typetag::deserialize(name = "gravity_gradient")]
    impl StageSpec for GravityGradientSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: imu_channels(),
            }]
        }

        fn output(&self) -> Vec<Channel> {
            let sigma = |name, width| Channel::vector(name, width, dim::Angle::KIND.dimension);
            vec![channel::ATTITUDE, sigma("attitude_sigma", 3), sigma("tilt_sigma", 2)]
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let at_origin = b.origin.map_or(STANDARD_GRAVITY, |o| LocalEarth::at(&o).gravity(b.gravity));
            Ok(Box::new(GravityGradient {
                attitude: b.quantity(state::ATTITUDE)?,
                gyro_bias: b.quantity(state::GYRO_BIAS).ok(),
                gain: self.gain.si(),
                floor: self.floor.si(),
                from: self.from,
                sigma: self.sigma.si(),
                adaptive: self.adaptive.si(),
                band: self.band.si(),
                gravity: self.gravity.map_or(at_origin, |g| g.si()),
                last: None,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::state::wrap;
    use fusion_core::testing::Lcg;
    use nalgebra::Quaternion;

    fn random_attitude(random: &mut Lcg) -> UnitQuaternion<f64> {
        so3::from_rpy(3.0 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed())
    }

    fn at_rest(q: &UnitQuaternion<f64>) -> Vector3<f64> {
        q.inverse() * Vector3::new(0.0, 0.0, -9.8)
    }

    #[test]
    fn the_gravity_error_vanishes_at_rest_and_its_jacobian_is_its_derivative() {
        let mut random = Lcg::new(1);
        for _ in 0..50 {
            let q = random_attitude(&mut random);
            let f = at_rest(&random_attitude(&mut random));
            assert!(gravity_error(&q, &at_rest(&q)).norm() < 1e-15); // a few ε of 1
            let (j, step) = (gravity_jacobian(&q), 1e-6);
            for k in 0..4 {
                // F is quadratic, so central differences are exact but for rounding; off the
                // sphere the formula holds as it is written.
                let at = |sign: f64| {
                    let mut v = so3::to_scalar_first(&q);
                    v[k] += sign * step;
                    let off = UnitQuaternion::new_unchecked(Quaternion::new(v[0], v[1], v[2], v[3]));
                    gravity_error(&off, &f)
                };
                let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
                assert!((slope - j.column(k)).norm() < 1e-9); // ε/step
            }
        }
    }

    #[test]
    fn gradient_step_takes_10_deg_of_tilt_to_9_887_and_ten_steps_to_8_869() {
        let f = Vector3::new(0.0, 0.0, -9.8);
        let tilt = |q: &UnitQuaternion<f64>| (q * Vector3::z()).z.clamp(-1.0, 1.0).acos().to_degrees();
        for start in [
            so3::from_rpy(10_f64.to_radians(), 0.0, 0.0),
            so3::from_rpy(0.0, 10_f64.to_radians(), 1.0),
        ] {
            let mut q = start;
            let yaw = so3::to_rpy(&q).z;
            for k in 1..=200 {
                q = gradient_step(&q, &f, 1e-3).unwrap_or(q);
                match k {
                    // 5e-4: half of the last digit printed.
                    1 => assert!((tilt(&q) - 9.887).abs() < 5e-4, "{}", tilt(&q)),
                    10 => assert!((tilt(&q) - 8.869).abs() < 5e-4, "{}", tilt(&q)),
                    // The limit cycle: 2μ = 0.1146°.
                    87.. => assert!(tilt(&q) <= 0.115, "step {k}: {}", tilt(&q)),
                    _ => {}
                }
            }
            // The vertical does not determine the heading; 1e-6: second order in the tilt about a skew axis.
            assert!(wrap(so3::to_rpy(&q).z - yaw).abs() < 1e-6);
        }
    }

    #[test]
    fn a_vertical_that_is_met_or_missing_gives_no_step() {
        let q = so3::from_rpy(0.1, 0.2, 0.3);
        assert_eq!(gradient_step(&q, &Vector3::zeros(), 1e-3), None);
        assert_eq!(
            gradient_step(&UnitQuaternion::identity(), &Vector3::new(0.0, 0.0, -1.0), 1e-3),
            None
        );
        assert!((step_length(1.5, 1e-5, &Vector3::new(0.0, 0.2, 0.0), 0.01) - 1.51e-3).abs() < 1e-17); // rounding
    }

    fn stage(from: StepFrom, bias: Vector3<f64>, q: UnitQuaternion<f64>) -> GravityGradient {
        GravityGradient {
            attitude: Quantity::Fixed(q),
            gyro_bias: Some(Quantity::Fixed(bias)),
            gain: 0.0,
            floor: 1e-3,
            from,
            sigma: 2e-3,
            adaptive: 300.0,
            band: 0.05,
            gravity: 10.0,
            last: None,
        }
    }

    /// The row of the second of two samples, 10 ms apart.
    fn emitted(stage: &mut GravityGradient, w: &Vector3<f64>, f: &Vector3<f64>) -> Option<Vec<f64>> {
        let view = View::new(&[], &[]);
        let row = [w.x, w.y, w.z, f.x, f.y, f.z];
        stage.row(0, Time::default(), &row, None, &mut Emitter::default());
        let mut out = Emitter::default();
        stage.row(0, Time::from_seconds(0.01), &row, Some(&view), &mut out);
        out.rows().next().map(|(_, row)| row.to_vec())
    }

    #[test]
    fn the_step_starts_at_the_prediction_or_a_sample_before_it() {
        let (w, bias) = (Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.1, 0.0, -0.1));
        let (before, f) = (so3::from_rpy(0.3, -0.2, 1.0), Vector3::new(0.0, 0.0, -10.0));
        let predicted = before * so3::exp(&((w - bias) * 0.01));
        for (from, start) in [(StepFrom::Last, before), (StepFrom::Predicted, predicted)] {
            let row = emitted(&mut stage(from, bias, predicted), &w, &f).unwrap();
            let (z, wanted) = (
                Quaternion::new(row[0], row[1], row[2], row[3]),
                gradient_step(&start, &f, 1e-3).unwrap(),
            );
            assert!((z - wanted.into_inner()).norm() < 1e-15, "{from:?}"); // rounding
        }
    }

    #[test]
    fn sigma_grows_with_the_acceleration_until_the_sample_is_left_out() {
        let q = UnitQuaternion::identity();
        let sigma = |f: f64| {
            let tilted = Vector3::new(0.6, 0.0, -0.8) * f;
            emitted(&mut stage(StepFrom::Predicted, Vector3::zeros(), q), &Vector3::zeros(), &tilted).map(|row| row[4..].to_vec())
        };
        assert_eq!(sigma(10.0), Some(vec![2e-3; 5]));
        // √(1 + 300·0.04²) = √1.48; 1e-12: rounding of |f|.
        assert!(
            sigma(10.4)
                .unwrap()
                .iter()
                .all(|s| (s / (2e-3 * 1.48_f64.sqrt()) - 1.0).abs() < 1e-12)
        );
        assert_eq!((sigma(10.6), sigma(9.4)), (None, None));
    }
}
