//! A quantity in the columns of a table.

use super::numbers::Vec3;
use core::ops::Range;
use fusion::source::table::LogTable;
use fusion_core::math;
use fusion_models::units::parse_unit;

/// A quantity that a filter can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The measurement of accelerometers.
    SpecificForce,
    /// The measurement of gyros.
    AngularRate,
    /// The magnetic field in sensor axes.
    MagneticField,
    /// Latitude, longitude and, if there is one, height.
    Geodetic,
    /// Metres north, east and down of a place.
    Local,
    /// Velocity north, east, down.
    Velocity,
    /// Velocity forward, right, down.
    BodyVelocity,
    /// Attitude as w, x, y, z.
    Quaternion,
    /// Roll, pitch and heading.
    Euler,
    /// Speed forward.
    Speed,
    /// Speed over ground from a receiver that does not report the course.
    GroundSpeed,
    /// Heading only, without roll and pitch.
    Heading,
    /// Turn rate.
    YawRate,
    /// Depth below the surface.
    Depth,
    /// Speeds of the left and the right wheels or tracks.
    Wheels,
    /// Pressure of the air or of the water.
    Pressure,
    /// 1σ of the position, as reported.
    PositionSigma,
    /// 1σ of the velocity, as reported.
    VelocitySigma,
    /// 1σ of the velocity forward, right, down, as reported.
    BodyVelocitySigma,
    /// 1σ of the speed, as reported.
    SpeedSigma,
    /// 1σ of the turn rate, as reported.
    YawRateSigma,
    /// 1σ of the attitude, as reported.
    AttitudeSigma,
}

impl Kind {
    /// Its name in words, the name of its channel, and why a design does not read it.
    const fn facts(self) -> [&'static str; 3] {
        const ANOTHER: &str = "another unit or an odometer drives the filter";
        const NOT_NEEDED: &str = "this design does not need it";
        const ESTIMATE: &str = "the estimate of another filter is no measurement";
        const SIGMA: &str = "rows lack it, the slow error in it is a state, or nothing here needs it";
        match self {
            Self::SpecificForce => ["specific force", "specific_force", ANOTHER],
            Self::AngularRate => ["angular rate", "angular_rate", ANOTHER],
            Self::MagneticField => ["magnetic field", "magnetic_field", "nothing here needs it"],
            Self::Geodetic => ["position, geodetic", "position", NOT_NEEDED],
            Self::Local => ["position, local", "position", NOT_NEEDED],
            Self::Velocity => ["velocity, north east down", "velocity", NOT_NEEDED],
            Self::BodyVelocity => ["velocity, body", "body_velocity", NOT_NEEDED],
            Self::Quaternion => ["attitude, quaternion", "attitude", ESTIMATE],
            Self::Euler => ["attitude, roll pitch yaw", "attitude", ESTIMATE],
            Self::Speed => ["speed", "speed", NOT_NEEDED],
            Self::GroundSpeed => [
                "speed over ground",
                "speed",
                "the receiver's own: without a course it is no velocity",
            ],
            Self::Heading => ["heading", "heading", "it does not follow the course, or nothing here needs it"],
            Self::YawRate => ["yaw rate", "yaw_rate", NOT_NEEDED],
            Self::Depth => ["depth", "depth", "the positions have one"],
            Self::Wheels => [
                "wheel speeds",
                "wheels",
                "a column has the speed itself, or no positions give the radius of the wheels",
            ],
            Self::Pressure => [
                "pressure",
                "pressure",
                "a barometer needs an inertial unit with positions that have a height, and air",
            ],
            Self::PositionSigma => ["1σ of position", "position_sigma", SIGMA],
            Self::VelocitySigma => ["1σ of velocity", "velocity_sigma", SIGMA],
            Self::BodyVelocitySigma => ["1σ of velocity, body", "body_velocity_sigma", SIGMA],
            Self::SpeedSigma => ["1σ of speed", "speed_sigma", SIGMA],
            Self::YawRateSigma => ["1σ of yaw rate", "yaw_rate_sigma", SIGMA],
            Self::AttitudeSigma => ["1σ of attitude", "attitude_sigma", SIGMA],
        }
    }

    /// The 1σ of this kind, as a log reports it.
    pub(super) const fn sigma(self) -> Option<Self> {
        Some(match self {
            Self::Geodetic | Self::Local => Self::PositionSigma,
            Self::Velocity => Self::VelocitySigma,
            Self::BodyVelocity => Self::BodyVelocitySigma,
            Self::Speed => Self::SpeedSigma,
            Self::YawRate => Self::YawRateSigma,
            Self::Quaternion => Self::AttitudeSigma,
            _ => return None,
        })
    }

    /// The plausible 1σ of instruments and of estimates, in SI, if this is one.
    pub(super) fn sigmas(self) -> Option<Range<f64>> {
        Some(match self {
            Self::PositionSigma => 1e-4..1e3,
            Self::VelocitySigma | Self::BodyVelocitySigma | Self::SpeedSigma => 1e-4..50.0,
            Self::YawRateSigma | Self::AttitudeSigma => 1e-5..1.0,
            _ => return None,
        })
    }

    /// The name in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.facts()[0]
    }

    /// The name of its channel.
    pub(super) const fn channel(self) -> &'static str {
        self.facts()[1]
    }

    /// Why a design does not read this kind.
    pub(super) const fn why_unused(self) -> &'static str {
        self.facts()[2]
    }
}

/// A quantity in a table.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Its kind.
    pub kind: Kind,
    /// Its columns in the order of the kind, and whether each has the opposite sign.
    pub columns: Vec<(usize, bool)>,
    /// The unit as designs write it; empty if it is unknown.
    pub unit: String,
    /// SI per unit of the columns.
    pub factor: f64,
    /// Whether the columns are increments over the interval between rows.
    pub increment: bool,
    /// The unit of the course, for a velocity as speed and course, which are the first two columns.
    pub course: Option<&'static str>,
    /// The unit of the height of a place.
    pub of_height: &'static str,
    /// Whether the names give the forward axis: the columns are forward, right, down.
    pub is_body: bool,
    /// The reason for this guess.
    pub why: String,
}

/// The reason if the unit is a guess: the usual unit.
pub(super) const UNNAMED: &str = "no unit is named";

impl Signal {
    /// The columns as a design names them.
    #[must_use]
    pub fn names(&self, table: &LogTable) -> Vec<String> {
        let name = |(k, is_against): &(usize, bool)| {
            let sign = if *is_against { "-" } else { "" };
            format!("{sign}{}", table.columns[*k].name)
        };
        self.columns.iter().map(name).collect()
    }

    /// Whether the columns hold the squares of a 1σ.
    pub(super) fn is_variance(&self) -> bool {
        self.kind.sigmas().is_some() && self.unit.ends_with("^2")
    }

    /// The value of a row, not yet in SI; missing axes are zero.
    pub(super) fn raw(&self, table: &LogTable, row: usize) -> Vec3 {
        [0, 1, 2].map(|axis| {
            self.columns.get(axis).map_or(0.0, |(k, is_against)| {
                let v = table.columns[*k].values[row];
                if *is_against { -v } else { v }
            })
        })
    }

    /// All values in SI; increments stay increments.
    pub(super) fn values(&self, table: &LogTable) -> Vec<Vec3> {
        let of = |row: usize| {
            let raw = self.raw(table, row);
            let Some(unit) = self.course else {
                return match (raw, self.unit.as_str()) {
                    ([latitude, longitude, height], "ddmm") => [of_ddmm(latitude), of_ddmm(longitude), height],
                    (raw, _) if self.is_variance() => raw.map(math::sqrt),
                    (raw, _) => raw.map(|v| v * self.factor),
                };
            };
            let (sin, cos) = math::sin_cos(raw[1] * factor(unit));
            // The course of a vehicle at rest is often empty.
            let (north, east) = if raw[0] == 0.0 { (0.0, 0.0) } else { (raw[0] * cos, raw[0] * sin) };
            [north, east, raw[2]].map(|v| v * self.factor)
        };
        (0..table.rows()).map(of).collect()
    }

    /// Sets a unit if no name gives one.
    pub(super) fn take_unit(&mut self, unit: &str, why: &str) {
        if !self.why.ends_with(UNNAMED) {
            return;
        }
        let found = self.why.split(';').next().unwrap_or_default();
        self.why = format!("{found}; {unit}: {why}");
        unit.clone_into(&mut self.unit);
        self.factor = factor(unit);
    }
}

/// SI per unit; one for counts and for no unit.
pub(super) fn factor(unit: &str) -> f64 {
    parse_unit(unit).map_or(1.0, |(size, _)| size)
}

/// Degrees and minutes in one number as rad.
fn of_ddmm(x: f64) -> f64 {
    let degrees = math::trunc(x / 100.0);
    (degrees + (x - 100.0 * degrees) / 60.0).to_radians()
}
