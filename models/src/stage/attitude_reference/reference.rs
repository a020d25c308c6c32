//! The attitude reference itself: what it does with a row of the IMU, of the magnetometer, of a
//! compass. It knows neither TOML nor streams.

use super::field_gate::FieldGate;
use super::kernel;
use super::quaternion_filter::{Kinematics, QuaternionFilter, measured_in_body_axes};
use fusion_core::geometry::so3;
use fusion_core::state::wrap;
use fusion_core::time::Time;
use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3};

/// How the accelerometers correct the tilt.
#[derive(Clone, Copy, Debug)]
pub enum Correction {
    /// A gradient step of every sample, as a measured quaternion.
    Gradient {
        /// α of the step length.
        alpha: f64,
        /// μ₀ of the step length.
        floor: f64,
        /// 1σ of each component of the measured quaternion, half that of an angle.
        sigma: f64,
        /// Takes the quaternion for a measurement of the heading too, as H = I₄ says, which it is
        /// not: the heading then looks far better known than it is.
        heading_too: bool,
        /// k of R = σ²(1 + k (|f|/g − 1)²).
        adaptive: f64,
        /// Samples with ||f| − g| > `band`·g are skipped.
        band: f64,
        /// Steps from the last estimate, as printed, instead of from the prediction.
        from_last: bool,
    },
    /// The specific force low-passed in axes that do not turn, as the vertical.
    LowPass {
        /// Of the low pass \[s\].
        time_constant: f64,
        /// 1σ of the vertical that it gives \[rad\].
        sigma: f64,
        /// Samples with ||f̄| − g| > `band`·g of the low-passed force are skipped.
        band: f64,
    },
}

/// How the compass corrects the heading.
#[derive(Clone, Debug)]
pub struct Compass {
    /// Clockwise from true to magnetic north \[rad\].
    pub declination: f64,
    /// A.
    pub soft_iron: Matrix3<f64>,
    /// b, in the unit of the field.
    pub hard_iron: Vector3<f64>,
    /// 1σ of a heading \[rad\].
    pub sigma: f64,
    /// Least time between two corrections \[ns\].
    pub period: i64,
    /// Which fields are left out.
    pub gate: Option<FieldGate>,
    /// Headings whose innovation is larger, in its own 1σ, are left out.
    pub max_innovation: f64,
}

/// Everything the reference is told once.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the quaternion is integrated.
    pub kinematics: Kinematics,
    /// N_g² per axis \[rad²/s\].
    pub gyro_psd: Matrix3<f64>,
    /// Initial 1σ of the gyro bias \[rad/s\]; zero where it is not estimated.
    pub bias_sigma: Vector3<f64>,
    /// Random walk of the bias \[rad²/s³\].
    pub bias_psd: Matrix3<f64>,
    /// How the tilt is corrected.
    pub correction: Correction,
    /// g \[m/s²\].
    pub gravity: f64,
    /// How long force and field are averaged for the first attitude \[s\].
    pub alignment: f64,
    /// 1σ of roll and pitch after the alignment \[rad\].
    pub tilt_sigma: f64,
    /// How the heading is corrected.
    pub compass: Option<Compass>,
}

/// Sums over the alignment.
#[derive(Clone, Copy, Debug, Default)]
struct Alignment {
    since: Option<Time>,
    force: Vector3<f64>,
    field: Vector3<f64>,
    fields: f64,
    heading: Option<f64>,
}

/// The attitude reference.
#[derive(Clone, Debug)]
pub struct AttitudeReference {
    settings: Settings,
    alignment: Alignment,
    belief: Option<QuaternionFilter>,
    /// Low-passed specific force, body axes.
    force: Vector3<f64>,
    /// Of the last heading used.
    turned: Option<Time>,
    last: Option<Time>,
}

impl AttitudeReference {
    /// One that has seen nothing yet.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            alignment: Alignment::default(),
            belief: None,
            force: Vector3::zeros(),
            turned: None,
            last: None,
        }
    }

    /// The belief, once aligned.
    #[must_use]
    pub const fn belief(&self) -> Option<&QuaternionFilter> {
        self.belief.as_ref()
    }

    /// Takes rate `w_ib_b` \[rad/s\] and force `f_b` \[m/s²\] of the interval that ends at `time`,
    /// while the navigation frame turns by `w_in_n` \[rad/s\].
    pub fn imu(&mut self, time: Time, w_ib_b: &Vector3<f64>, f_b: &Vector3<f64>, w_in_n: &Vector3<f64>) {
        let dt = self.last.map_or(0.0, |last| time.seconds_since(last));
        self.last = Some(time);
        let Some(belief) = &mut self.belief else {
            self.align(time, f_b);
            return;
        };
        let s = &self.settings;
        let before = belief.q;
        let w = kernel::compensated_rate(&(w_ib_b - belief.bias), &before, w_in_n);
        belief.predict(&w, dt, &s.gyro_psd, &s.bias_psd, s.kinematics);
        let off = |f: &Vector3<f64>| f.norm() / s.gravity - 1.0;
        match s.correction {
            Correction::Gradient {
                alpha,
                floor,
                sigma,
                heading_too,
                adaptive,
                band,
                from_last,
            } => {
                let from = if from_last { before } else { belief.q };
                let step = kernel::gradient_step(&from, f_b, kernel::step_length(alpha, floor, &w, dt));
                if let Some(z) = step.filter(|_| off(f_b).abs() <= band) {
                    let variance = sigma * sigma * (1.0 + adaptive * off(f_b).powi(2));
                    let noise = if heading_too {
                        Matrix4::identity() * variance
                    } else {
                        of_vertical(&belief.q, 4.0 * variance)
                    };
                    belief.update(&z, &noise);
                }
            }
            Correction::LowPass {
                time_constant,
                sigma,
                band,
            } => {
                self.force = kernel::low_passed(&self.force, f_b, &w, dt, time_constant);
                if off(&self.force).abs() <= band && dt > 0.0 {
                    // Neighbours share what the low pass holds: 2τ/Δt of them say as much as one.
                    let variance = sigma * sigma * (2.0 * time_constant / dt).max(1.0);
                    let z = kernel::levelled(&belief.q, &self.force);
                    belief.update(&z, &of_vertical(&belief.q, variance));
                }
            }
        }
    }

    /// Takes a raw field (any unit).
    pub fn field(&mut self, time: Time, raw: &Vector3<f64>) {
        let Some(compass) = &mut self.settings.compass else { return };
        let m = kernel::calibrated(raw, &compass.soft_iron, &compass.hard_iron);
        let Some(belief) = &self.belief else {
            self.alignment.field += m;
            self.alignment.fields += 1.0;
            return;
        };
        let seen = kernel::field(&m, &belief.q, compass.declination);
        if compass.gate.as_mut().is_some_and(|gate| !gate.passes(&seen, time)) {
            return;
        }
        let m_n = belief.q * m;
        self.turn(time, seen.turn, &m_n);
    }

    /// Takes a heading \[rad\] of a compass, clockwise from magnetic north.
    pub fn heading(&mut self, time: Time, heading: f64) {
        let Some(compass) = &self.settings.compass else { return };
        let heading = wrap(heading + compass.declination);
        let Some(belief) = &self.belief else {
            self.alignment.heading = Some(heading);
            return;
        };
        let c = so3::rotation(&belief.q);
        if c[(2, 0)].abs() <= so3::GIMBAL_LOCK_C31 {
            self.turn(time, wrap(heading - c[(1, 0)].atan2(c[(0, 0)])), &c.column(0).into_owned());
        }
    }

    /// Corrects the heading by `turn` \[rad\], at which the direction `v_n` says it is wrong: at
    /// most once per period, and if the gate lets it.
    fn turn(&mut self, time: Time, turn: f64, v_n: &Vector3<f64>) {
        let (Some(compass), Some(belief)) = (&self.settings.compass, &mut self.belief) else {
            return;
        };
        let due = self.turned.is_none_or(|last| time.nanos() - last.nanos() >= compass.period);
        if !due {
            return;
        }
        let limit = compass.max_innovation * compass.max_innovation;
        let passes = |squared: f64, variance: f64| squared <= limit * variance;
        if belief.update_heading(turn, &kernel::heading_slope(v_n), compass.sigma * compass.sigma, passes) {
            self.turned = Some(time);
        }
    }

    fn align(&mut self, time: Time, f_b: &Vector3<f64>) {
        let a = &mut self.alignment;
        a.force += f_b;
        let since = *a.since.get_or_insert(time);
        let s = &mut self.settings;
        let waiting = s.compass.is_some() && a.heading.is_none() && a.fields == 0.0;
        if time.seconds_since(since) < s.alignment || waiting || a.force == Vector3::zeros() {
            return;
        }
        let mut q = kernel::levelled(&UnitQuaternion::identity(), &a.force);
        if let Some(compass) = &mut s.compass {
            let turn = match a.heading {
                Some(heading) => wrap(heading - so3::to_rpy(&q).z),
                None => {
                    let seen = kernel::field(&(a.field / a.fields), &q, compass.declination);
                    if let Some(gate) = &mut compass.gate {
                        gate.learn(&seen);
                    }
                    seen.turn
                }
            };
            q = kernel::turned(&q, turn);
        }
        let heading_sigma = s.compass.as_ref().map_or(core::f64::consts::PI, |c| c.sigma);
        let sigma_n = Vector3::new(s.tilt_sigma, s.tilt_sigma, heading_sigma);
        let p_b = in_body_axes(&q, &sigma_n.component_mul(&sigma_n));
        self.force = a.force.normalize() * s.gravity;
        self.belief = Some(QuaternionFilter::new(q, &p_b, Vector3::zeros(), &s.bias_sigma));
    }
}

/// Variance of what a measurement does not tell \[rad²\].
const UNKNOWN: f64 = 100.0;

/// A diagonal covariance in navigation axes, seen in body axes.
fn in_body_axes(q: &UnitQuaternion<f64>, variance_n: &Vector3<f64>) -> Matrix3<f64> {
    let c_nb = so3::rotation(q);
    c_nb.transpose() * Matrix3::from_diagonal(variance_n) * c_nb
}

/// R of a measured quaternion that tells the vertical, to `variance` \[rad²\] per axis, and no heading.
fn of_vertical(q: &UnitQuaternion<f64>, variance: f64) -> Matrix4<f64> {
    measured_in_body_axes(q, &in_body_axes(q, &Vector3::new(variance, variance, UNKNOWN)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.81;
    const DT: f64 = 0.01;

    fn settings(correction: Correction) -> Settings {
        let gate = FieldGate {
            magnitude: 0.05,
            dip: 0.05,
            adopt_after: 20.0,
            reference: None,
            other: None,
        };
        let compass = Compass {
            declination: -0.1,
            soft_iron: Matrix3::identity(),
            hard_iron: Vector3::zeros(),
            sigma: 0.1,
            period: 33_000_000,
            gate: Some(gate),
            max_innovation: 3.0,
        };
        Settings {
            kinematics: Kinematics::Exact,
            gyro_psd: Matrix3::identity() * 1e-6,
            bias_sigma: Vector3::repeat(0.01),
            bias_psd: Matrix3::zeros(),
            correction,
            gravity: G,
            alignment: 1.0,
            tilt_sigma: 0.03,
            compass: Some(compass),
        }
    }

    const LOW_PASS: Correction = Correction::LowPass {
        time_constant: 1.5,
        sigma: 0.01,
        band: 0.05,
    };

    fn gradient(heading_too: bool) -> Correction {
        Correction::Gradient {
            alpha: 1.5,
            floor: 1e-4,
            sigma: 2e-3,
            heading_too,
            adaptive: 0.0,
            band: 0.05,
            from_last: true,
        }
    }

    /// Declination −0.1 rad, dip 1 rad.
    fn field_n() -> Vector3<f64> {
        Vector3::new(0.1_f64.cos() * 1_f64.cos(), -0.1_f64.sin() * 1_f64.cos(), 1_f64.sin()) * 5e-5
    }

    /// Runs a body of attitude `q` at rest, whose gyros have a bias, while it is accelerated by `a_n(t)`.
    fn run(
        reference: &mut AttitudeReference,
        q: &UnitQuaternion<f64>,
        seconds: (f64, f64),
        bias: &Vector3<f64>,
        a_n: impl Fn(f64) -> Vector3<f64>,
        m_n: &Vector3<f64>,
    ) {
        let steps = |t: f64| (t / DT).round() as i64;
        for k in steps(seconds.0)..steps(seconds.1) {
            let t = k as f64 * DT;
            let f = q.inverse() * (a_n(t) - Vector3::new(0.0, 0.0, G));
            reference.imu(Time::from_seconds(t), bias, &f, &Vector3::zeros());
            reference.field(Time::from_seconds(t), &(q.inverse() * m_n));
        }
    }

    fn error(reference: &AttitudeReference, q: &UnitQuaternion<f64>) -> Vector3<f64> {
        so3::log(&(reference.belief().unwrap().q * q.inverse()))
    }

    fn rest(_: f64) -> Vector3<f64> {
        Vector3::zeros()
    }

    #[test]
    fn the_first_attitude_is_level_and_heads_to_true_north() {
        let q = so3::from_rpy(0.4, -0.8, 2.5);
        let mut reference = AttitudeReference::new(settings(LOW_PASS));
        run(&mut reference, &q, (0.0, 0.99), &Vector3::zeros(), rest, &field_n());
        assert!(reference.belief().is_none(), "a second has not passed");
        run(&mut reference, &q, (0.99, 1.02), &Vector3::zeros(), rest, &field_n());
        assert!(error(&reference, &q).norm() < 1e-12); // rounding of sums of 100
    }

    #[test]
    fn gyro_biases_of_all_axes_are_found_at_rest() {
        let q = so3::from_rpy(0.4, -0.8, 2.5);
        let bias = Vector3::new(0.006, -0.004, 0.008);
        for correction in [LOW_PASS, gradient(false)] {
            let mut reference = AttitudeReference::new(settings(correction));
            run(&mut reference, &q, (0.0, 120.0), &bias, rest, &field_n());
            let found = reference.belief().unwrap().bias;
            // A tenth: of the heading's axis a compass of 0.1 rad tells no more in two minutes.
            assert!((found - bias).norm() < 0.1 * bias.norm(), "{correction:?}: {found}");
            assert!(error(&reference, &q).norm() < 0.01, "{correction:?}");
        }
    }

    #[test]
    fn shaking_is_averaged_by_the_low_pass() {
        let q = so3::from_rpy(0.1, 0.0, 1.0);
        // 3 m/s² at 1 Hz from the second second on: |f| differs from g by 5 % at most.
        let shake = |t: f64| {
            if t > 2.0 {
                Vector3::x() * 3.0 * (core::f64::consts::TAU * t).sin()
            } else {
                Vector3::zeros()
            }
        };
        let worst = |correction| {
            let mut reference = AttitudeReference::new(settings(correction));
            let mut worst: f64 = 0.0;
            for k in 0..300 {
                let t = f64::from(k) * 0.1;
                run(&mut reference, &q, (t, t + 0.1), &Vector3::zeros(), shake, &field_n());
                if reference.belief().is_some() {
                    worst = worst.max(error(&reference, &q).xy().norm());
                }
            }
            worst
        };
        // The force is off by 0.306 rad. The low pass passes 1/(2π·1.5) of that, the filter less.
        assert!(worst(LOW_PASS) < 0.0325, "{}", worst(LOW_PASS));
        assert!(worst(gradient(false)) > worst(LOW_PASS));
    }

    #[test]
    fn a_disturbed_field_is_left_out_and_one_that_stays_is_believed_in_the_end() {
        let q = so3::from_rpy(0.1, -0.2, 1.0);
        let mut reference = AttitudeReference::new(settings(LOW_PASS));
        run(&mut reference, &q, (0.0, 5.0), &Vector3::zeros(), rest, &field_n());
        // A magnet: 20 % more field, and 0.28 rad of heading.
        let magnet = so3::exp(&Vector3::new(0.0, 0.0, 0.28)) * field_n() * 1.2;
        run(&mut reference, &q, (5.0, 24.0), &Vector3::zeros(), rest, &magnet);
        // What the bias is not known to may turn it a little.
        assert!(error(&reference, &q).norm() < 1e-3, "{}", error(&reference, &q));
        run(&mut reference, &q, (24.0, 90.0), &Vector3::zeros(), rest, &magnet);
        assert!(error(&reference, &q).z < -0.1, "{}", error(&reference, &q));
        let mut trusting = settings(LOW_PASS);
        trusting.compass.as_mut().unwrap().gate = None;
        let mut reference = AttitudeReference::new(trusting);
        run(&mut reference, &q, (0.0, 5.0), &Vector3::zeros(), rest, &field_n());
        run(&mut reference, &q, (5.0, 24.0), &Vector3::zeros(), rest, &magnet);
        assert!(error(&reference, &q).z < -0.05, "without a gate it is believed at once");
    }

    #[test]
    fn a_heading_of_an_instrument_serves_as_well_as_a_field() {
        let q = so3::from_rpy(0.2, 0.1, -3.0);
        let mut reference = AttitudeReference::new(settings(LOW_PASS));
        for k in 0..500 {
            let time = Time::from_seconds(f64::from(k) * DT);
            reference.heading(time, wrap(-3.0 + 0.1));
            reference.imu(
                time,
                &Vector3::zeros(),
                &(q.inverse() * Vector3::new(0.0, 0.0, -G)),
                &Vector3::zeros(),
            );
        }
        assert!(error(&reference, &q).norm() < 1e-9); // rounding of 400 updates
    }

    #[test]
    fn a_heading_taken_for_measured_drowns_the_compass() {
        let q = so3::from_rpy(0.1, -0.2, 1.0);
        // A bias for the gradient to work against: where there is none it takes no step.
        let sigma = |heading_too| {
            let mut reference = AttitudeReference::new(settings(gradient(heading_too)));
            run(&mut reference, &q, (0.0, 20.0), &Vector3::new(1e-3, 1e-3, 0.0), rest, &field_n());
            reference.belief().unwrap().heading_variance().sqrt()
        };
        assert!(sigma(true) < 0.2 * sigma(false), "{} {}", sigma(true), sigma(false));
    }
}
