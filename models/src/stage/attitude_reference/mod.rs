//! The attitude reference: attitude from gyros, accelerometers and a compass, on its own.
//!
//! Output     `attitude` q_nb, `heading` \[rad\], `attitude_sigma` about the body axes \[rad\];
//!            `angular_rate` less the bias found, `specific_force` as it came: a row of the IMU
//!            with its attitude, so that a process may be driven by this stage alone
//! Predicted  quaternion kinematics of w_nb_b = w_ib_b − b − C_nbᵀ (w_ie_n + w_en_n)
//! Corrected  by the vertical, with every sample ([`reference::Correction`]):
//!            `gradient`, a gradient step as a measured quaternion, as a paper prints it;
//!            `low_pass`, the specific force low-passed in axes that do not turn. Under sustained
//!            acceleration |f| ≈ g tells nothing, and only averaging finds the vertical
//!            by the compass, at its own rate: the heading alone, gated
//! Filter     [`quaternion_filter`]: the quaternion, and the gyro bias where declared
//! Mind       the compass gate learns |m| and dip while the filter aligns: start undisturbed, or
//!            declare the field. With `heading = "measured"` (H = I₄) the filter believes its own
//!            heading, so that σ is too small and the compass hardly heard
//! Not here   what the filter behind this stage knows of the attitude: it is not fed back

pub mod field_gate;
pub mod kernel;
pub mod quaternion_filter;
pub mod reference;

use crate::block::{Build, BuildError, Channel, Listen, Shape, StageSpec, imu_channels};
use crate::earth::{LocalEarth, rates};
use crate::units::{self, Axes, Dimension, Dimensional, NonNegative, Positive, Quantity, STANDARD_GRAVITY, Vec3Of, dim, range};
use field_gate::FieldGateSpec;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic as Place;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Geodetic, Quantity as StateQuantity, Velocity, View};
use fusion_core::time::{Time, nanos};
use nalgebra::{Matrix3, Vector3};
use quaternion_filter::Kinematics;
use reference::{AttitudeReference, Compass, Correction, Settings};
use schemars::JsonSchema;
use serde::Deserialize;
use std::borrow::Cow;

/// Attitude from gyros, accelerometers and a compass: a filter of its own, whose rows hold
/// `attitude`, `heading`, `attitude_sigma`, `angular_rate` and `specific_force`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AttitudeReferenceSpec {
    /// The IMU stream.
    source: String,
    /// White noise of the gyros: the angle random walk.
    gyro_noise: Axes<dim::AngleRandomWalk, range::NonNegative>,
    /// The gyro bias as a state; without it the gyros are taken for unbiased.
    gyro_bias: Option<BiasSpec>,
    /// How the quaternion is integrated.
    #[serde(default)]
    integration: Integration,
    /// Which turning of the navigation frame is taken out of the gyros.
    #[serde(default)]
    compensation: Compensation,
    /// Latitude for `compensation` and gravity until the filter has a position, or without one; by
    /// default that of the origin.
    latitude: Option<units::Latitude>,
    /// How the accelerometers correct roll and pitch.
    #[serde(default)]
    correction: CorrectionSpec,
    /// The numbers of `correction = "gradient"`; of no use with the other, as `low_pass` here.
    gradient: Option<GradientSpec>,
    /// The numbers of `correction = "low_pass"`.
    low_pass: Option<LowPassSpec>,
    /// What corrects the heading.
    compass: Option<CompassSpec>,
    /// How long force and field are averaged for the first attitude; the body should be at rest.
    #[serde(default = "one_second")]
    alignment: Positive<dim::Duration>,
    /// 1σ of roll and pitch after the alignment.
    #[serde(default = "two_degrees")]
    tilt_sigma: Positive<dim::Angle>,
}

/// The gyro bias of an attitude reference.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BiasSpec {
    /// Initial 1σ.
    sigma: Axes<dim::AngularRate, range::NonNegative>,
    /// Random walk.
    #[serde(default = "constant")]
    random_walk: Axes<dim::RateRandomWalk, range::NonNegative>,
}

/// How a quaternion is integrated.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Integration {
    /// q + q̇Δt, normalised, as a paper prints it.
    #[default]
    Literal,
    /// q ⊗ Exp(wΔt).
    Exact,
}

/// Which turning of the navigation frame is taken out of the gyros.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum Compensation {
    /// That of the Earth, and of moving over it once the filter has a velocity.
    #[default]
    EarthAndTransport,
    /// That of the Earth.
    Earth,
    /// None.
    None,
}

/// How the accelerometers correct roll and pitch.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum CorrectionSpec {
    /// A gradient step of every sample, as a measured quaternion.
    #[default]
    Gradient,
    /// The specific force low-passed in axes that do not turn.
    LowPass,
}

/// The gradient correction: steps of length α|q̇|Δt + μ₀.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct GradientSpec {
    /// α, the step in units of what the gyros turned.
    gain: NonNegative<dim::Ratio>,
    /// μ₀, the step at rest: half the tilt that one sample corrects. The limit cycle is twice it.
    floor: Positive<dim::Ratio>,
    /// 1σ of each component of the measured quaternion.
    sigma: Positive<dim::Ratio>,
    /// k of R = σ²(1 + k (|f|/g − 1)²); 0 is a constant R.
    adaptive: NonNegative<dim::Ratio>,
    /// Samples are skipped where |f| differs from g by more than this share of g.
    band: Positive<dim::Ratio>,
    /// Where the step starts.
    from: StepFrom,
    /// Whether the measured quaternion counts as a measurement of the heading.
    heading: HeadingOf,
}

impl Default for GradientSpec {
    fn default() -> Self {
        Self {
            gain: constant_of(1.5),
            floor: constant_of(1e-4),
            sigma: constant_of(2e-3),
            adaptive: NonNegative::default(),
            band: constant_of(0.05),
            from: StepFrom::default(),
            heading: HeadingOf::default(),
        }
    }
}

/// Where a gradient step starts.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum StepFrom {
    /// The last estimate, as a paper prints it: the measured quaternion lags by one sample.
    #[default]
    Last,
    /// The prediction.
    Predicted,
}

/// What a quaternion that was made of the vertical says of the heading.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum HeadingOf {
    /// As much as of the tilt: H = I₄ with a scalar R, as a paper prints it.
    #[default]
    Measured,
    /// Nothing, which is true.
    Free,
}

/// The low-pass correction.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct LowPassSpec {
    /// Time constant: longer than the accelerations last, shorter than the gyros drift.
    time_constant: Positive<dim::Duration>,
    /// 1σ of the vertical that the low-passed force gives; that neighbours are correlated over
    /// the time constant is taken into account.
    sigma: Positive<dim::Angle>,
    /// The low-passed force is skipped where its size differs from g by more than this share of g.
    band: Positive<dim::Ratio>,
}

impl Default for LowPassSpec {
    fn default() -> Self {
        Self {
            time_constant: constant_of(1.5),
            sigma: constant_of(0.5_f64.to_radians()),
            band: constant_of(0.05),
        }
    }
}

/// The compass of an attitude reference.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CompassSpec {
    /// Its stream; it may be that of the IMU.
    source: String,
    /// What it delivers.
    #[serde(default)]
    channel: CompassChannel,
    /// 1σ of a heading, all of the slow error included.
    sigma: Positive<dim::Angle>,
    /// Corrections per second at most.
    #[serde(default = "thirty_hertz")]
    rate: Positive<dim::Frequency>,
    /// Where magnetic north lies clockwise from true north.
    #[serde(default)]
    declination: units::Angle,
    /// A of m = A (m_raw − hard_iron), row by row.
    #[serde(default = "no_soft_iron")]
    soft_iron: [Vec3Of<dim::Ratio>; 3],
    /// What the body itself adds to the field.
    #[serde(default)]
    hard_iron: Vec3Of<dim::MagneticField>,
    /// Which fields are left out; without it none.
    gate: Option<FieldGateSpec>,
    /// Headings whose innovation is larger, in its own 1σ, are left out; without it none.
    max_innovation: Option<Positive<dim::Ratio>>,
}

/// What a compass delivers.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
enum CompassChannel {
    /// The channel `magnetic_field`, three axes; the tilt is compensated here.
    #[default]
    MagneticField,
    /// The channel `heading`, from magnetic north.
    Heading,
}

/// A default that lies in its range.
fn constant_of<D: Dimensional, R: units::Range>(value: f64) -> Quantity<D, R> {
    Quantity::try_from_si(value).unwrap_or_else(|_| unreachable!("the default {value} is in range"))
}

fn one_second() -> Positive<dim::Duration> {
    constant_of(1.0)
}

fn two_degrees() -> Positive<dim::Angle> {
    constant_of(2_f64.to_radians())
}

pub(crate) fn thirty_hertz() -> Positive<dim::Frequency> {
    constant_of(30.0)
}

fn constant() -> Axes<dim::RateRandomWalk, range::NonNegative> {
    [NonNegative::default(); 3].into()
}

pub(crate) fn no_soft_iron() -> [Vec3Of<dim::Ratio>; 3] {
    let row = |i: usize| core::array::from_fn(|j| Quantity::from_si(f64::from(i == j))).into();
    [row(0), row(1), row(2)]
}

crate::register!(
    Stage,
    "attitude_reference",
    AttitudeReferenceSpec,
    r#"
source = "imu"
gyro_noise = "0.1 deg/sqrt(s)"
gyro_bias = { sigma = "0.5 deg/s", random_walk = "1e-4 deg/s/sqrt(s)" }
integration = "exact"
compensation = "earth_and_transport"
latitude = "36.1 deg"
correction = "low_pass"
low_pass = { time_constant = "1.5 s", sigma = "0.5 deg", band = "5 %" }
compass = { source = "imu", sigma = "10 deg", rate = "30 Hz", declination = "-8 deg", gate = { magnitude = "5 %", dip = "3 deg" }, max_innovation = 3 }
alignment = "1 s"
"#
);

#[typetag::deserialize(name = "attitude_reference")]
impl StageSpec for AttitudeReferenceSpec {
    fn inputs(&self) -> Vec<Listen> {
        let mut inputs = vec![Listen {
            source: self.source.clone(),
            channels: imu_channels(),
        }];
        if let Some(compass) = &self.compass {
            let channel = match compass.channel {
                CompassChannel::MagneticField => Channel::vector("magnetic_field", 3, dim::MagneticField::KIND.dimension),
                CompassChannel::Heading => heading_channel(),
            };
            inputs.push(Listen {
                source: compass.source.clone(),
                channels: vec![channel],
            });
        }
        inputs
    }

    fn output(&self) -> Vec<Channel> {
        let attitude = Channel {
            name: Cow::Borrowed("attitude"),
            width: 4,
            dimension: Dimension::NONE,
            shape: Shape::Quaternion,
        };
        let sigma = Channel::vector("attitude_sigma", 3, dim::Angle::KIND.dimension);
        let mut channels = vec![attitude, heading_channel(), sigma];
        channels.extend(imu_channels());
        channels
    }

    fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
        let place = match self.latitude {
            Some(latitude) => Some(Place {
                lat: latitude.si(),
                lon: 0.0,
                height: 0.0,
            }),
            None => b.origin,
        };
        let position = b.quantity("position").ok();
        if place.is_none() && position.is_none() && self.compensation != Compensation::None {
            let help = "give `latitude`, or an origin under [run]; or set `compensation = \"none\"`";
            return Err(BuildError::at("compensation", "the latitude is not known, nor therefore the Earth's rate").help(help));
        }
        let gravity = place.map_or(STANDARD_GRAVITY, |p| LocalEarth::at(&p).gravity(b.gravity));
        let velocity = b
            .quantity("velocity")
            .ok()
            .filter(|_| self.compensation == Compensation::EarthAndTransport);
        Ok(Box::new(Runtime {
            reference: AttitudeReference::new(self.settings(gravity)),
            channel: self.compass.as_ref().map_or(CompassChannel::Heading, |c| c.channel),
            compensation: self.compensation,
            place,
            position,
            velocity,
        }))
    }
}

pub(crate) fn heading_channel() -> Channel {
    Channel {
        name: Cow::Borrowed("heading"),
        width: 1,
        dimension: dim::Angle::KIND.dimension,
        shape: Shape::Angle,
    }
}

impl AttitudeReferenceSpec {
    fn correction(&self) -> Correction {
        match self.correction {
            CorrectionSpec::Gradient => {
                let g = self.gradient.unwrap_or_default();
                Correction::Gradient {
                    alpha: g.gain.si(),
                    floor: g.floor.si(),
                    sigma: g.sigma.si(),
                    heading_too: g.heading == HeadingOf::Measured,
                    adaptive: g.adaptive.si(),
                    band: g.band.si(),
                    from_last: g.from == StepFrom::Last,
                }
            }
            CorrectionSpec::LowPass => {
                let l = self.low_pass.unwrap_or_default();
                Correction::LowPass {
                    time_constant: l.time_constant.si(),
                    sigma: l.sigma.si(),
                    band: l.band.si(),
                }
            }
        }
    }

    fn settings(&self, gravity: f64) -> Settings {
        let square = |n: [f64; 3]| Matrix3::from_diagonal(&Vector3::from(n.map(|n| n * n)));
        Settings {
            kinematics: match self.integration {
                Integration::Literal => Kinematics::Literal,
                Integration::Exact => Kinematics::Exact,
            },
            gyro_psd: square(self.gyro_noise.si()),
            bias_sigma: self.gyro_bias.map_or_else(Vector3::zeros, |b| b.sigma.si().into()),
            bias_psd: self.gyro_bias.map_or_else(Matrix3::zeros, |b| square(b.random_walk.si())),
            correction: self.correction(),
            gravity,
            alignment: self.alignment.si(),
            tilt_sigma: self.tilt_sigma.si(),
            compass: self.compass.as_ref().map(CompassSpec::build),
        }
    }
}

impl CompassSpec {
    fn build(&self) -> Compass {
        let rows = self.soft_iron.map(|row| Vector3::from(row.si()).transpose());
        Compass {
            declination: self.declination.si(),
            soft_iron: Matrix3::from_rows(&rows),
            hard_iron: self.hard_iron.si().into(),
            sigma: self.sigma.si(),
            period: nanos(1.0 / self.rate.si()),
            gate: self.gate.filter(|g| g.enabled).map(|g| g.build()),
            max_innovation: self.max_innovation.map_or(f64::INFINITY, |limit| limit.si()),
        }
    }
}

/// The stage at run time.
#[derive(Clone, Debug)]
struct Runtime {
    reference: AttitudeReference,
    channel: CompassChannel,
    compensation: Compensation,
    place: Option<Place>,
    position: Option<StateQuantity<Geodetic>>,
    velocity: Option<StateQuantity<Velocity>>,
}

impl Runtime {
    /// w_in_n \[rad/s\], as far as it is known.
    fn frame_rate(&self, view: Option<&View<'_>>) -> Vector3<f64> {
        let known = view.zip(self.position.as_ref()).map(|(view, position)| view.get(position));
        let (Some(place), true) = (known.or(self.place), self.compensation != Compensation::None) else {
            return Vector3::zeros();
        };
        let velocity = view.zip(self.velocity.as_ref()).map(|(view, velocity)| view.get(velocity));
        let transport = velocity.map_or_else(Vector3::zeros, |v| rates::transport_rate_n(&place, &v));
        rates::earth_rate_n(place.lat) + transport
    }
}

impl Stage for Runtime {
    fn row(&mut self, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>, out: &mut Emitter) {
        if !row.iter().all(|v| v.is_finite()) {
            return;
        }
        match (input, self.channel) {
            (0, _) => {
                let (w, f) = (Vector3::new(row[0], row[1], row[2]), Vector3::new(row[3], row[4], row[5]));
                self.reference.imu(time, &w, &f, &self.frame_rate(view));
                if let Some(belief) = self.reference.belief() {
                    let (q, w, sigma) = (belief.q, w - belief.bias, belief.attitude_sigma());
                    let heading = so3::to_rpy(&q).z;
                    out.emit(
                        time,
                        &[q.w, q.i, q.j, q.k, heading, sigma.x, sigma.y, sigma.z, w.x, w.y, w.z, f.x, f.y, f.z],
                    );
                }
            }
            (_, CompassChannel::MagneticField) => self.reference.field(time, &Vector3::new(row[0], row[1], row[2])),
            (_, CompassChannel::Heading) => self.reference.heading(time, row[0]),
        }
    }

    fn boxed_clone(&self) -> Box<dyn Stage> {
        Box::new(self.clone())
    }
}
