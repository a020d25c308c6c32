//! From the cells of a channel to its numbers.

use super::plan::ChannelPlan;
use super::turns::{Turns, of_matrix};
use core::f64::consts::{FRAC_PI_2, TAU};
use core::fmt;
use core::ops::RangeInclusive;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_models::earth::LocalFrame;
use fusion_models::earth::frames::geodetic_from_ecef;
use fusion_models::earth::utm::Zone;
use fusion_models::plausible::{Impossible, Possible};
use nalgebra::{Matrix3, UnitQuaternion, Vector3, Vector4};

/// The largest number of inputs of a form other than a vector: the elements of a matrix.
const WIDEST: usize = 9;
/// The smallest distance from the Earth's centre \[m\]; zeros mean a missing fix.
const NEAREST: f64 = 1e6;
/// Range of grid coordinates \[m\], with the neighbouring zones; beyond it, columns or units are wrong.
const EASTINGS: RangeInclusive<f64> = -1e6..=2e6;
const NORTHINGS: RangeInclusive<f64> = -1e7..=1e7;

/// The result of the conversion.
#[derive(Clone, Debug)]
pub(super) enum Conversion {
    Vector {
        rotation: Option<Matrix3<f64>>,
    },
    /// Speed, course and, if known, velocity down.
    Course,
    Geodetic(Angles),
    /// Earth-centred Earth-fixed.
    Ecef,
    /// Easting, northing, height.
    Utm(Zone),
    /// North, east, down; the frame is given when the source is opened.
    Local {
        frame: Option<LocalFrame>,
    },
    Attitude {
        written: Written,
        navigation: UnitQuaternion<f64>,
        sensor: UnitQuaternion<f64>,
        inverse: bool,
    },
}

/// How latitudes and longitudes are written.
#[derive(Clone, Debug)]
pub(super) enum Angles {
    /// As multiples of this unit.
    Of(String),
    /// `4854.554` is 48° 54.554′.
    DegreesAndMinutes,
}

/// How an attitude is written.
#[derive(Clone, Copy, Debug)]
pub(super) enum Written {
    Quaternion,
    /// A matrix, row by row.
    Matrix,
    /// Roll, pitch and heading.
    Rpy,
    /// Angles of a sequence of turns.
    Euler(Turns),
}

/// A mistake in the values of a row.
pub(in super::super) struct Wrong {
    pub(in super::super) message: String,
    pub(in super::super) help: Option<&'static str>,
}

impl Wrong {
    const fn new(message: String) -> Self {
        Self { message, help: None }
    }
}

impl From<Impossible> for Wrong {
    fn from(impossible: Impossible) -> Self {
        // A position was checked before, as it is written.
        Self::new(impossible.to_string())
    }
}

impl ChannelPlan {
    /// Whether a local position needs its origin.
    pub(in super::super) const fn needs_origin(&self) -> bool {
        matches!(self.conversion, Conversion::Local { frame: None })
    }

    /// Gives a local position its origin.
    pub(in super::super) fn set_origin(&mut self, origin: Geodetic) {
        if let Conversion::Local { frame } = &mut self.conversion {
            *frame = Some(LocalFrame::new(origin));
        }
    }

    /// Makes the channel's numbers from the numbers read; increments cover the `interval` \[s\].
    pub(in super::super) fn convert(&mut self, read: &[f64], interval: f64, out: &mut [f64]) -> Result<(), Wrong> {
        let mut scaled = [0.0; WIDEST];
        // A vector has as many numbers as are read, and may be wider than any other form.
        if let Conversion::Vector { rotation } = &self.conversion {
            self.scale(read, interval, out)?;
            if let Some(rotation) = rotation {
                let turned = rotation * Vector3::new(out[0], out[1], out[2]);
                out.copy_from_slice(turned.as_slice());
            }
        } else {
            let scaled = &mut scaled[..read.len()];
            self.scale(read, interval, scaled)?;
            if let Conversion::Geodetic(angles) = &self.conversion {
                self.place(angles, read, scaled)?;
            }
            self.conversion.apply(scaled, out)?;
        }
        self.possible.check(out)?;
        if self.average {
            let previous = self.previous.get_or_insert_with(|| out.to_vec());
            for (out, previous) in out.iter_mut().zip(previous) {
                let now = core::mem::replace(out, 0.5 * (*out + *previous));
                *previous = now;
            }
        }
        Ok(())
    }

    /// Latitude and longitude \[rad\], within their ranges.
    fn place(&self, angles: &Angles, read: &[f64], out: &mut [f64]) -> Result<(), Wrong> {
        let column = |i: usize| self.inputs[i].name();
        if matches!(angles, Angles::DegreesAndMinutes) {
            for (i, out) in out.iter_mut().enumerate().take(2) {
                *out = of_degrees_and_minutes(*out).ok_or_else(|| {
                    let message = format!("`{}` in column `{}` has 60 minutes or more", read[i].abs(), column(i));
                    Wrong {
                        message,
                        help: Some("if the columns are in degrees, write `unit = \"deg\"`"),
                    }
                })?;
            }
        }
        let (i, what) = match *out {
            [lat, ..] if lat.abs() > FRAC_PI_2 => (0, "latitude: it lies beyond a pole"),
            [_, lon, ..] if lon.abs() > TAU => (1, "longitude: it is more than a turn"),
            _ => return Ok(()),
        };
        Err(Wrong {
            message: format!("{} {angles} in column `{}` is not a {what}", read[i], column(i)),
            help: angles.instead(read[0], read[1]),
        })
    }

    /// Number by number: unit and scale, root of a variance, offset, increment to rate.
    fn scale(&self, read: &[f64], interval: f64, out: &mut [f64]) -> Result<(), Wrong> {
        for (i, (out, cell)) in out.iter_mut().zip(read).enumerate() {
            let mut number = self.factor[i] * cell;
            if self.variance {
                if number < 0.0 {
                    let column = self.inputs[i].name();
                    return Err(Wrong::new(format!("the variance {cell} in column `{column}` is negative")));
                }
                number = math::sqrt(number);
            }
            number += self.add[i];
            *out = if self.increment { number / interval } else { number };
        }
        Ok(())
    }
}

impl Conversion {
    /// Turns the numbers as a whole; a vector keeps its own.
    fn apply(&self, read: &[f64], out: &mut [f64]) -> Result<(), Wrong> {
        let position = match self {
            Self::Course => {
                let (sin, cos) = math::sin_cos(read[1]);
                let velocity = [read[0] * cos, read[0] * sin, third(read)];
                out.copy_from_slice(&velocity[..out.len()]);
                return Ok(());
            }
            Self::Vector { .. } | Self::Geodetic(_) | Self::Local { frame: None } => {
                out.copy_from_slice(read);
                return Ok(());
            }
            Self::Attitude {
                written,
                navigation,
                sensor,
                inverse,
            } => {
                let q = written.attitude(read)?;
                let q = navigation * if *inverse { q.inverse() } else { q } * sensor;
                out.copy_from_slice(so3::to_scalar_first(&q).as_slice());
                return Ok(());
            }
            Self::Local { frame: Some(frame) } => frame.to_geodetic(&Vector3::new(read[0], read[1], third(read))),
            Self::Ecef => {
                let from_centre = Vector3::new(read[0], read[1], read[2]);
                if from_centre.norm() < NEAREST {
                    return Err(Wrong::new(format!(
                        "{:.0} m from the Earth's centre is no position",
                        from_centre.norm()
                    )));
                }
                geodetic_from_ecef(&from_centre)
            }
            Self::Utm(zone) => {
                let [easting, northing, height] = [read[0], read[1], third(read)];
                if !(EASTINGS.contains(&easting) && NORTHINGS.contains(&northing)) {
                    let message = format!("easting {easting} m, northing {northing} m lie outside every zone");
                    return Err(Wrong::new(message));
                }
                zone.to_geodetic(easting, northing, height)
            }
        };
        // A horizontal position is as wide as latitude and longitude.
        out.copy_from_slice(&[position.lat, position.lon, position.height][..out.len()]);
        Ok(())
    }
}

impl fmt::Display for Angles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Of(unit) => f.write_str(unit),
            Self::DegreesAndMinutes => f.write_str("(degrees and minutes)"),
        }
    }
}

impl Angles {
    /// A hint about the columns if a number is not a latitude or longitude.
    fn instead(&self, lat: f64, lon: f64) -> Option<&'static str> {
        let are = |lat: f64, lon: f64| lat.abs() <= 90.0 && lon.abs() <= 360.0;
        let of_minutes = |number: f64| of_degrees_and_minutes(number).map(f64::to_degrees);
        let may_be_minutes = || of_minutes(lat).zip(of_minutes(lon)).is_some_and(|(lat, lon)| are(lat, lon));
        match self {
            Self::Of(unit) if unit == "rad" && are(lat, lon) => Some("if the columns are in degrees, write `unit = \"deg\"`"),
            Self::Of(unit) if unit == "deg" && are(lon, lat) => Some("are latitude and longitude exchanged?"),
            Self::Of(_) if may_be_minutes() => {
                Some("if they are degrees and minutes, as NMEA writes them (ddmm.mmmm), write `unit = \"ddmm\"`")
            }
            _ => None,
        }
    }
}

/// The angle \[rad\] of `ddmm.mmmm`; `None` for 60 minutes and more.
fn of_degrees_and_minutes(number: f64) -> Option<f64> {
    let degrees = math::trunc(number.abs() / 100.0);
    let minutes = number.abs() - 100.0 * degrees;
    (minutes < 60.0).then(|| (degrees + minutes / 60.0).to_radians().copysign(number))
}

/// The height or depth among the numbers read. A horizontal position or velocity has none: 0 is used, and latitude
/// and longitude hardly depend on it.
fn third(read: &[f64]) -> f64 {
    read.get(2).copied().unwrap_or_default()
}

impl Written {
    /// The attitude as written.
    fn attitude(self, read: &[f64]) -> Result<UnitQuaternion<f64>, Wrong> {
        match self {
            Self::Quaternion => {
                Possible::Quaternion.check(read)?;
                Ok(so3::from_scalar_first(&Vector4::from_column_slice(read)))
            }
            Self::Matrix => of_matrix(read).map_err(Wrong::new),
            Self::Rpy => Ok(so3::from_rpy(read[0], read[1], read[2])),
            Self::Euler(turns) => Ok(turns.attitude(read)),
        }
    }
}
