//! The fields of the sentences of an estimate.

use super::{Outgoing, Sentence};
use core::f64::consts::{FRAC_PI_2, PI};
use fusion::core::geometry::so3::wrap_angle;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::health::State;
use fusion::core::math;
use fusion::solution::{Solution, rpy_of, sigmas};
use fusion::source::table::utc_text;
use nalgebra::{Matrix3, Vector3};

/// How far the estimate may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Invalid,
    Estimated,
    Autonomous,
}

impl Mode {
    const fn quality(self) -> char {
        match self {
            Self::Invalid => '0',
            Self::Estimated => '6',
            Self::Autonomous => '1',
        }
    }

    const fn status(self) -> char {
        match self {
            Self::Invalid | Self::Estimated => 'V',
            Self::Autonomous => 'A',
        }
    }

    const fn letter(self) -> char {
        match self {
            Self::Invalid => 'N',
            Self::Estimated => 'E',
            Self::Autonomous => 'A',
        }
    }
}

/// A heading with a greater 1σ \[rad\] is not valid: 30°, at which the attitude of a filter is no longer aligned.
const VAGUE: f64 = PI / 6.0;
/// A knot \[m/s\].
const KNOT: f64 = 1852.0 / 3600.0;
/// A kilometre per hour \[m/s\].
const KILOMETRE_PER_HOUR: f64 = 1.0 / 3.6;

/// The estimate of now.
pub(super) struct Now {
    mode: Mode,
    gps_nanos: Option<i64>,
    /// Position, velocity and heading are those of a valid estimate.
    position: Option<(Geodetic, Matrix3<f64>)>,
    velocity: Option<(Vector3<f64>, Matrix3<f64>)>,
    /// \[rad\].
    heading: Option<f64>,
}

impl Now {
    pub(super) fn of(estimate: &Outgoing) -> Self {
        let Solution {
            position,
            velocity,
            attitude,
            ..
        } = estimate.solution.unwrap_or_default();
        let position = position.filter(|(place, _)| is_on_earth(place));
        let mode = match (estimate.health, position) {
            (State::Lost, _) | (_, None) => Mode::Invalid,
            (State::Good, _) => Mode::Autonomous,
            _ => Mode::Estimated,
        };
        let is_valid = mode != Mode::Invalid;
        let heading = attitude.map(|(q, p)| rpy_of(&q, &p)).filter(|(_, sigma)| sigma.z <= VAGUE);
        Self {
            mode,
            gps_nanos: estimate.gps_nanos,
            position: position.filter(|_| is_valid),
            velocity: velocity.filter(|_| is_valid),
            heading: heading.map(|(rpy, _)| rpy.z).filter(|_| is_valid),
        }
    }

    /// The fields of a sentence; `None` if it is not sent.
    pub(super) fn fields(&self, sentence: Sentence) -> Option<String> {
        let Self { mode, .. } = self;
        Some(match sentence {
            Sentence::Gga => {
                let height = self.position.map(|(place, _)| place.height);
                let separation = height.map(|_| 0.0);
                format!(
                    "{},{},{},,,{},M,{},M,,",
                    self.time(),
                    self.place(),
                    mode.quality(),
                    number(height, 3),
                    number(separation, 1)
                )
            }
            Sentence::Rmc => {
                let date = self.date().map(|[day, month, year]| format!("{day}{month}{}", &year[2..]));
                format!(
                    "{},{},{},{},{},{},,,{},V",
                    self.time(),
                    mode.status(),
                    self.place(),
                    number(self.speed(KNOT), 2),
                    turn(self.course()),
                    date.unwrap_or_default(),
                    mode.letter()
                )
            }
            Sentence::Gst => {
                let sigma = self.position.map(|(_, p)| sigmas(&p));
                let [north, east, down] = [0, 1, 2].map(|axis| number(sigma.map(|sigma| sigma[axis]), 3));
                let ellipse = self.position.map(|(_, p)| ellipse(&p));
                let [major, minor] = [0, 1].map(|axis| number(ellipse.map(|(axes, _)| axes[axis]), 3));
                let direction = turn(ellipse.map(|(_, direction)| direction));
                format!("{},,{major},{minor},{direction},{north},{east},{down}", self.time())
            }
            Sentence::Hdt => format!("{},T", turn(Some(self.heading?))),
            Sentence::Ths => {
                let mode = self.heading.map_or(Mode::Invalid, |_| *mode);
                let letter = if mode == Mode::Invalid { 'V' } else { mode.letter() };
                format!("{},{letter}", turn(self.heading))
            }
            Sentence::Vtg => format!(
                "{},T,,M,{},N,{},K,{}",
                turn(self.course()),
                number(self.speed(KNOT), 2),
                number(self.speed(KILOMETRE_PER_HOUR), 2),
                mode.letter()
            ),
            Sentence::Zda => {
                let [day, month, year] = self.date()?;
                format!("{},{day},{month},{year},00,00", self.time())
            }
        })
    }

    /// The second of UTC, such as `2025-07-08T19:34:18Z`, and its milliseconds.
    fn utc(&self) -> Option<(String, i64)> {
        // Half a millisecond: the nearest millisecond.
        let millis = self.gps_nanos?.saturating_add(500_000).div_euclid(1_000_000);
        Some((utc_text(millis.div_euclid(1000)), millis.rem_euclid(1000)))
    }

    /// `193418.250`.
    fn time(&self) -> String {
        let text = |(utc, millis): (String, i64)| format!("{}{}{}.{millis:03}", &utc[11..13], &utc[14..16], &utc[17..19]);
        self.utc().map_or_else(String::new, text)
    }

    /// Day, month, year.
    fn date(&self) -> Option<[String; 3]> {
        let (utc, _) = self.utc()?;
        Some([8..10, 5..7, 0..4].map(|digits| utc[digits].to_owned()))
    }

    /// `4717.1143700,N,00833.9152200,E`.
    fn place(&self) -> String {
        let Some((place, _)) = self.position else {
            return ",,,".to_owned();
        };
        let (latitude, longitude) = (place.lat, wrap_angle(place.lon));
        let side = |angle: f64, sides: [char; 2]| sides[usize::from(angle < 0.0)];
        format!(
            "{},{},{},{}",
            degrees_and_minutes(latitude, 2),
            side(latitude, ['N', 'S']),
            degrees_and_minutes(longitude, 3),
            side(longitude, ['E', 'W'])
        )
    }

    /// The speed over ground in a unit \[m/s\].
    fn speed(&self, unit: f64) -> Option<f64> {
        self.velocity.map(|(v, _)| math::hypot(v.x, v.y) / unit)
    }

    /// The course over ground \[rad\], if the speed is greater than its 1σ.
    fn course(&self) -> Option<f64> {
        let (v, p) = self.velocity?;
        let is_moving = v.x * v.x + v.y * v.y > p[(0, 0)] + p[(1, 1)];
        is_moving.then(|| math::atan2(v.y, v.x))
    }
}

/// Whether a position is finite and its latitude is that of the earth.
fn is_on_earth(place: &Geodetic) -> bool {
    place.lat.abs() <= FRAC_PI_2 && place.lon.is_finite() && place.height.is_finite()
}

/// A number as text; empty without a finite number.
fn number(number: Option<f64>, decimals: usize) -> String {
    let finite = number.filter(|number| number.is_finite());
    finite.map_or_else(String::new, |number| format!("{number:.decimals$}"))
}

/// A direction \[rad\] as degrees from 0 to 359.99.
pub(super) fn turn(direction: Option<f64>) -> String {
    let finite = direction.filter(|direction| direction.is_finite());
    finite.map_or_else(String::new, |direction| {
        let hundredths = (math::round(direction.to_degrees() * 100.0) as i64).rem_euclid(36_000);
        format!("{}.{:02}", hundredths / 100, hundredths % 100)
    })
}

/// The size of an angle \[rad\] as degrees and minutes with seven decimals: 0.2 mm.
pub(super) fn degrees_and_minutes(angle: f64, digits: usize) -> String {
    const MINUTE: i64 = 10_000_000;
    let parts = math::round(angle.abs().to_degrees() * (60 * MINUTE) as f64) as i64;
    let (minutes, parts) = (parts / MINUTE, parts % MINUTE);
    format!("{:0digits$}{:02}.{parts:07}", minutes / 60, minutes % 60)
}

/// The 1σ \[m\] along and across the direction of the largest error, and that direction \[rad\], from 0 to π.
///
/// The eigenvalues of the covariance of north and east are mean ± radius, those of a circle of Mohr.
pub(super) fn ellipse(p: &Matrix3<f64>) -> ([f64; 2], f64) {
    let mean = (p[(0, 0)] + p[(1, 1)]) / 2.0;
    let (difference, common) = ((p[(0, 0)] - p[(1, 1)]) / 2.0, p[(0, 1)]);
    let radius = math::hypot(difference, common);
    let direction = math::atan2(common, difference) / 2.0;
    // An error along one direction only has a rounding error of either sign across it.
    let across = mean - radius;
    let across = if across.abs() <= 1e-12 * mean { 0.0 } else { across };
    let axes = [mean + radius, across].map(math::sqrt);
    (axes, if direction < 0.0 { direction + PI } else { direction })
}
