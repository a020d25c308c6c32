//! A ship, moored or under way, and its instruments: GPS, attitude reference, acoustic system. A platform is a further
//! ship, with a name.
//!
//! Ship       its reference point moves along the mean heading at a steady speed, and on a circle about that
//!            path; roll, pitch and yaw are sines. The phases are drawn. Axes of the ship forward-right-down
//! Pose       the true value of the states of a sensor `vessel_pose`, which measures it with its own errors
//! Streams    where declared: `ship_gps`: position of the antenna. `ship_attitude`: attitude. `transceiver`: slant range r,
//!            bearing β from the transceiver's x axis towards y, depression δ below its x-y plane
//! Acoustic   s = C_usᵀ [C_snᵀ (p + C_nb l_t − p_s) − l_u], r = (1 + κ)|s|; κ, the error of the speed of
//!            sound, is drawn once. A measurement is valid when the transponder replies; its row is
//!            stamped r/c + `processing` later, when it arrives
//! Timing     the next measurement comes `least` plus the size of a normal number times `spread` later, or
//!            anything from `least` to `most`, uniformly; and `least` later for each ping that is not heard, `longest`
//!            in a row at most
//! Not here   multipath, refraction, and the way of the sound down to the transponder

use super::random::Random;
use crate::block::{BuildError, Channel};
use crate::earth::LocalFrame;
use crate::fault::Windows;
use crate::process::strapdown::mechanisation::Nav;
use crate::units::{Axes, NonNegative, Positive, Probability, Quantity, Vec3Of, dim, range};
use crate::vocabulary::channel;
use core::f64::consts::TAU;
use fusion_core::Time;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::time::nanos;
use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// A ship near the vehicle, moored or under way. A sensor `vessel_pose` measures its pose. With `gps`, `attitude` and
/// `usbl` the ship has its own instruments.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShipSpec {
    /// Where its reference point is on the mean, under way at the start: north, east, down of the origin of the run.
    position: Vec3Of<dim::Length>,
    /// Its mean heading.
    heading: Quantity<dim::Angle>,
    /// Its steady speed along the mean heading.
    #[serde(default)]
    speed: NonNegative<dim::Speed>,
    /// The circle that the reference point runs round, at its steady pace.
    watch_circle: Option<CircleSpec>,
    /// Its roll.
    roll: Option<SineSpec>,
    /// Its pitch.
    pitch: Option<SineSpec>,
    /// Its yaw about the mean heading.
    yaw: Option<SineSpec>,
    /// The antenna of `gps` in the axes of the ship, from the reference point.
    antenna: Option<Vec3Of<dim::Length>>,
    /// The transceiver of `usbl` in the axes of the ship, from the reference point.
    transceiver: Option<Vec3Of<dim::Length>>,
    /// Roll, pitch, yaw of the transceiver's axes in the ship: x_ship = C(mounting) x_transceiver.
    #[serde(default)]
    mounting: Option<Vec3Of<dim::Angle>>,
    /// The transponder on the body, in body axes.
    #[serde(default)]
    transponder: Option<Vec3Of<dim::Length>>,
    /// The stream `ship_gps`.
    pub(super) gps: Option<ShipGpsSpec>,
    /// The stream `ship_attitude`.
    pub(super) attitude: Option<ShipAttitudeSpec>,
    /// The stream `transceiver`.
    pub(super) usbl: Option<TransceiverSpec>,
}

impl ShipSpec {
    /// Whether it has the instrument that makes a stream.
    pub(super) const fn has(&self, stream: usize) -> bool {
        match stream {
            0 => self.gps.is_some(),
            1 => self.attitude.is_some(),
            _ => self.usbl.is_some(),
        }
    }

    /// The streams of its instruments: their numbers in [`SHIP_STREAMS`], and their names. `platform` is the name of a
    /// platform; `None` for the ship.
    pub fn streams(&self, platform: Option<&str>) -> impl Iterator<Item = (usize, String)> {
        let names = ship_instruments(platform).map(|(stream, _)| stream);
        names.into_iter().enumerate().filter(|(i, _)| self.has(*i))
    }

    /// Refuses an instrument without a place; `table` is the table of the ship.
    pub(super) fn check(&self, table: &str) -> Result<(), BuildError> {
        let places = [
            ("antenna", "gps", self.antenna, self.has(0)),
            ("transceiver", "usbl", self.transceiver, self.has(ACOUSTIC)),
        ];
        match places.into_iter().find(|(.., place, is_there)| *is_there && place.is_none()) {
            None => Ok(()),
            Some((key, of, ..)) => {
                let help = format!("add `{key} = [\"… m\", \"… m\", \"… m\"]`, forward, right and down of the reference point of the ship");
                Err(BuildError::at(format!("{table}.{of}"), format!("`{of}` needs the place of its {key} on the ship")).help(help))
            }
        }
    }
}

/// A circle at a steady pace.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct CircleSpec {
    /// Its radius.
    radius: NonNegative<dim::Length>,
    /// Time for one round.
    period: Positive<dim::Duration>,
}

/// An angle that swings.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SineSpec {
    /// Its amplitude.
    amplitude: NonNegative<dim::Angle>,
    /// Its period.
    period: Positive<dim::Duration>,
}

/// The ship's GPS.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShipGpsSpec {
    /// Rows per second; at most 1e9 in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// 1σ of white noise, north, east, down.
    #[serde(default)]
    white: Option<Axes<dim::Length, range::NonNegative>>,
}

/// The ship's attitude reference.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShipAttitudeSpec {
    /// Rows per second; at most 1e9 in a run.
    pub(super) rate: Positive<dim::Frequency>,
    /// 1σ of white noise about the axes of the ship.
    #[serde(default)]
    white: Option<Axes<dim::Angle, range::NonNegative>>,
    /// 1σ of a constant error about these axes, drawn once per run.
    #[serde(default)]
    bias_sigma: Option<Axes<dim::Angle, range::NonNegative>>,
}

/// The acoustic system.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransceiverSpec {
    /// Time from one measurement to the next.
    interval: IntervalSpec,
    /// Pings that are not heard; all are without it.
    unheard: Option<UnheardSpec>,
    /// 1σ of white noise of the range.
    #[serde(default)]
    range_white: NonNegative<dim::Length>,
    /// 1σ of white noise of bearing and depression.
    #[serde(default)]
    angle_white: Option<Axes<dim::Angle, range::NonNegative, 2>>,
    /// 1σ of the relative error of the assumed speed of sound (assumed/true − 1), drawn once per run.
    #[serde(default)]
    sound_speed_sigma: NonNegative<dim::Ratio>,
    /// Assumed speed of sound.
    sound_speed: Positive<dim::Speed>,
    /// Time that the ship needs to make a row from a reply.
    #[serde(default)]
    processing: NonNegative<dim::Duration>,
}

/// How long until the next measurement.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct IntervalSpec {
    /// The shortest interval, a millisecond at least.
    least: Positive<dim::Duration>,
    /// Intervals are longer by this times the magnitude of a normal number.
    #[serde(default)]
    spread: NonNegative<dim::Duration>,
    /// The longest interval of a uniform distribution.
    most: Option<Positive<dim::Duration>>,
}

/// Pings that are not heard.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct UnheardSpec {
    /// Their share.
    rate: Probability,
    /// The largest number of them in a row.
    longest: u32,
    /// Times at which the water is loud.
    loud: Option<LoudSpec>,
}

/// Times at which more pings are not heard.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LoudSpec {
    /// Their share then.
    rate: Probability,
    /// When.
    window: Windows,
}

impl UnheardSpec {
    /// The share of the pings that are not heard at `time`.
    fn rate(&self, time: Time) -> f64 {
        let loud = self.loud.as_ref().filter(|loud| loud.window.contains(time));
        loud.map_or(self.rate, |loud| loud.rate).si()
    }
}

/// The streams of a ship with all its instruments; [`ship_channels`] lists their channels.
pub const SHIP_STREAMS: [&str; 3] = ["ship_gps", "ship_attitude", "transceiver"];

/// The streams of the ship, or of the platform of that name, each with its table under `[simulation]`.
#[must_use]
pub fn ship_instruments(platform: Option<&str>) -> [(String, String); 3] {
    let tables = ["gps", "attitude", "usbl"];
    core::array::from_fn(|i| match platform {
        None => (SHIP_STREAMS[i].to_owned(), format!("ship.{}", tables[i])),
        Some(name) => {
            let stream = SHIP_STREAMS[i].trim_start_matches("ship_");
            (format!("{name}_{stream}"), format!("platform.{name}.{}", tables[i]))
        }
    })
}

/// The acoustic system among them.
pub(super) const ACOUSTIC: usize = 2;

/// The channels of these streams.
#[must_use]
pub fn ship_channels(stream: usize) -> Vec<Channel> {
    match stream {
        0 => vec![channel::POSITION],
        1 => vec![channel::ATTITUDE],
        _ => vec![channel::RANGE, channel::BEARING, channel::DEPRESSION],
    }
}

/// A sine with a phase.
#[derive(Clone, Copy, Debug)]
struct Sine {
    amplitude: f64,
    rate: f64,
    phase: f64,
}

impl Sine {
    fn new(spec: Option<SineSpec>, random: &mut Random) -> Self {
        let phase = TAU * random.unit();
        let (amplitude, rate) = spec.map_or((0.0, 0.0), |s| (s.amplitude.si(), TAU / s.period.si()));
        Self { amplitude, rate, phase }
    }

    fn at(&self, t: f64) -> f64 {
        self.amplitude * math::sin(self.rate * t + self.phase)
    }
}

/// The simulated ship: stateful, seeded.
#[derive(Clone, Debug)]
pub(super) struct Ship {
    spec: ShipSpec,
    frame: LocalFrame,
    /// Angle on the watch circle: radius, rate, phase.
    circle: Sine,
    swing: [Sine; 3],
    mounting: UnitQuaternion<f64>,
    /// Constant error of the attitude about the ship's axes.
    attitude_bias: Vector3<f64>,
    /// κ.
    sound_speed_error: f64,
    gps: Random,
    attitude: Random,
    acoustic: Random,
    timing: Random,
    hearing: Random,
}

impl Ship {
    /// `platform` is the name of a platform; `None` for the ship.
    pub(super) fn new(spec: &ShipSpec, platform: Option<&str>, origin: Geodetic, seed: u64) -> Self {
        let of = platform.map_or_else(|| "ship".to_owned(), |name| format!("platform/{name}"));
        let random = |what: &str| Random::new(seed, &format!("{of}/{what}"));
        let mut phases = random("phases");
        let mut circle = Sine::new(None, &mut phases);
        if let Some(c) = spec.watch_circle {
            (circle.amplitude, circle.rate) = (c.radius.si(), TAU / c.period.si());
        }
        let [roll, pitch, yaw] = spec.mounting.map_or([0.0; 3], Vec3Of::si);
        let mut constant = random("attitude bias");
        let bias = spec.attitude.and_then(|attitude| attitude.bias_sigma).map_or([0.0; 3], Axes::si);
        Self {
            circle,
            swing: [spec.roll, spec.pitch, spec.yaw].map(|s| Sine::new(s, &mut phases)),
            mounting: so3::from_rpy(roll, pitch, yaw),
            attitude_bias: Vector3::from(bias).map(|sigma| sigma * constant.normal()),
            sound_speed_error: spec.usbl.as_ref().map_or(0.0, |usbl| usbl.sound_speed_sigma.si()) * random("sound speed").normal(),
            gps: random("gps"),
            attitude: random("attitude"),
            acoustic: random("acoustic"),
            timing: random("timing"),
            hearing: random("hearing"),
            frame: LocalFrame::new(origin),
            spec: spec.clone(),
        }
    }

    /// Where the reference point is, and the attitude C_sn.
    pub(super) fn pose(&self, time: Time) -> (Geodetic, UnitQuaternion<f64>) {
        let t = time.seconds();
        let (sin, cos) = math::sin_cos(self.circle.rate * t + self.circle.phase);
        let off = Vector3::new(cos, sin, 0.0) * self.circle.amplitude;
        let heading = self.spec.heading.si();
        let way = Vector3::new(math::cos(heading), math::sin(heading), 0.0) * (self.spec.speed.si() * t);
        let place = self.frame.to_geodetic(&(Vector3::from(self.spec.position.si()) + way + off));
        let [roll, pitch, yaw] = self.swing.map(|s| s.at(t));
        (place, so3::from_rpy(roll, pitch, heading + yaw))
    }

    /// How long after the measurement at `now` the next one comes \[ns\]; `None` without an acoustic system.
    pub(super) fn interval(&mut self, now: Time) -> Option<i64> {
        let usbl = self.spec.usbl.as_ref()?;
        let IntervalSpec { least, spread, most } = usbl.interval;
        let missed = usbl.unheard.as_ref().map_or(0, |unheard| {
            let rate = unheard.rate(now);
            (0..unheard.longest).take_while(|_| self.hearing.unit() < rate).count()
        });
        let more = match most {
            Some(most) => (most.si() - least.si()).max(0.0) * self.timing.unit(),
            None => spread.si() * self.timing.normal().abs(),
        };
        Some(nanos(least.si() * (1 + missed) as f64 + more).max(SHORTEST))
    }

    /// The row of a stream that is valid at `time`, where the body is at `nav`, and its stamp; `None` without the
    /// instrument.
    pub(super) fn measure(&mut self, stream: usize, time: Time, nav: &Nav) -> Option<(Time, Vec<f64>)> {
        let (place, c_sn) = self.pose(time);
        let arm = |place: Option<Vec3Of<dim::Length>>| Vector3::from(place.map_or([0.0; 3], Vec3Of::si));
        Some(match stream {
            0 => {
                let white = Vector3::from(self.spec.gps?.white.map_or([0.0; 3], Axes::si));
                let noise = white.map(|sigma| sigma * self.gps.normal());
                let antenna = place.offset(&(c_sn * arm(self.spec.antenna) + noise));
                (time, vec![antenna.lat, antenna.lon, antenna.height])
            }
            1 => {
                let white = Vector3::from(self.spec.attitude?.white.map_or([0.0; 3], Axes::si));
                let noise = white.map(|sigma| sigma * self.attitude.normal()) + self.attitude_bias;
                let q = so3::canonical(&(c_sn * so3::exp(&noise)));
                (time, vec![q.w, q.i, q.j, q.k])
            }
            _ => {
                let transponder = nav.q_nb * arm(self.spec.transponder);
                let away = nav.position.difference(&place) + transponder;
                let from = c_sn.inverse() * away - arm(self.spec.transceiver);
                let s = self.mounting.inverse() * from;
                let level = math::hypot(s.x, s.y);
                let usbl = self.spec.usbl.as_ref()?;
                let [bearing, depression] = usbl.angle_white.map_or([0.0; 2], Axes::si);
                let mut noise = |sigma: f64| sigma * self.acoustic.normal();
                let row = vec![
                    s.norm() * (1.0 + self.sound_speed_error) + noise(usbl.range_white.si()),
                    so3::wrap_angle(math::atan2(s.y, s.x) + noise(bearing)),
                    math::atan2(s.z, level) + noise(depression),
                ];
                let late = s.norm() / usbl.sound_speed.si() + usbl.processing.si();
                (time.shifted(nanos(late)), row)
            }
        })
    }
}

/// The shortest time between two measurements \[ns\].
const SHORTEST: i64 = 1_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: Geodetic = Geodetic::new(0.630_033_801_5, 2.259_327_747_1, 0.0);

    fn ship(usbl: &str) -> Ship {
        let text = format!(
            "position = [-6, 20, -2]\nheading = '60 deg'\nwatch_circle = {{ radius = 2, period = 90 }}\n\
             roll = {{ amplitude = '2 deg', period = 8 }}\nyaw = {{ amplitude = '2 deg', period = 120 }}\n\
             antenna = [-3, 1, -8]\ntransceiver = [4, -2, 3]\nmounting = [0, 0, '45 deg']\ntransponder = [0.5, 0, -1]\n\
             gps = {{ rate = 5 }}\nattitude = {{ rate = 10 }}\nusbl = {{ sound_speed = 1500, {usbl} }}"
        );
        Ship::new(&toml::from_str(&text).unwrap(), None, ORIGIN, 3)
    }

    #[test]
    fn the_streams_lead_back_to_the_transponder() {
        let mut ship = ship("interval = { least = 1 }");
        let nav = Nav {
            position: ORIGIN.offset(&Vector3::new(9.0, -4.0, 23.0)),
            v_eb_n: Vector3::zeros(),
            q_nb: so3::from_rpy(0.1, -0.2, 2.0),
        };
        for k in 0..200 {
            let time = Time::from_seconds(0.9 * f64::from(k));
            let (_, gps) = ship.measure(0, time, &nav).unwrap();
            let (_, q) = ship.measure(1, time, &nav).unwrap();
            let (stamp, polar) = ship.measure(2, time, &nav).unwrap();
            let c_sn = so3::from_scalar_first(&nalgebra::Vector4::new(q[0], q[1], q[2], q[3]));
            let ((sb, cb), (sd, cd)) = (polar[1].sin_cos(), polar[2].sin_cos());
            let s = Vector3::new(cd * cb, cd * sb, sd) * polar[0];
            let arm = Vector3::new(7.0, -3.0, 11.0) + so3::from_rpy(0.0, 0.0, 45_f64.to_radians()) * s;
            let found = Geodetic::new(gps[0], gps[1], gps[2]).offset(&(c_sn * arm));
            let wanted = nav.position.offset(&(nav.q_nb * Vector3::new(0.5, 0.0, -1.0)));
            // 5e-4 m: the axes at antenna and transponder differ over 40 m.
            assert!(found.difference(&wanted).norm() < 5e-4, "{}", found.difference(&wanted));
            assert!((stamp.seconds_since(time) - polar[0] / 1500.0).abs() < 1e-8);
        }
    }

    #[test]
    fn intervals_follow_their_law() {
        let draw = |usbl| {
            let mut ship = ship(usbl);
            (0..4000)
                .map(|k| ship.interval(Time::from_seconds(f64::from(k))).unwrap() as f64 * 1e-9)
                .collect::<Vec<_>>()
        };
        let near_one = draw("interval = { least = 1, spread = 0.05 }");
        let mean = near_one.iter().sum::<f64>() / 4000.0;
        // The mean of a half-normal number is 0.798 σ; 3 %: 4000 of them.
        assert!(
            near_one.iter().all(|t| *t >= 1.0) && ((mean - 1.0) / 0.0399 - 1.0).abs() < 0.03,
            "{mean}"
        );
        let deep = draw("interval = { least = 2, most = 10 }");
        let mean = deep.iter().sum::<f64>() / 4000.0;
        assert!(deep.iter().all(|t| (2.0..=10.0).contains(t)) && (mean - 6.0).abs() < 0.15, "{mean}");
        let loud = "loud = { rate = '60 %', window = { from = 2000, to = 9000 } }";
        let gaps = draw(&format!(
            "interval = {{ least = 1 }}, unheard = {{ rate = '15 %', longest = 4, {loud} }}"
        ));
        let share = |gaps: &[f64], at_most: f64| gaps.iter().filter(|t| **t <= at_most).count() as f64 / 2000.0;
        let (quiet, loud) = gaps.split_at(2000);
        // 0.03: four sigma of a share of 2000. Four in a row at most: 0.6^4 of the loud ones last 5 s.
        assert!((share(quiet, 1.0) - 0.85).abs() < 0.03 && (share(loud, 1.0) - 0.4).abs() < 0.03);
        assert!((share(loud, 4.0) - (1.0 - 0.6_f64.powi(4))).abs() < 0.03 && share(loud, 5.0) == 1.0);
    }
}
