//! Finds the quantity in each column of a table.

use super::numbers::{Vec3, median, norm, quantile};
use super::turn;
use super::words::{QUATERNION, Words, contains, is_called, is_height, is_phrase};
use fusion::source::table::{LogColumn, LogTable};
use fusion_core::math;

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
}

impl Kind {
    /// The name in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpecificForce => "specific force",
            Self::AngularRate => "angular rate",
            Self::MagneticField => "magnetic field",
            Self::Geodetic => "position, geodetic",
            Self::Local => "position, local",
            Self::Velocity => "velocity, north east down",
            Self::BodyVelocity => "velocity, body",
            Self::Quaternion => "attitude, quaternion",
            Self::Euler => "attitude, roll pitch yaw",
            Self::Speed => "speed",
            Self::GroundSpeed => "speed over ground",
            Self::Heading => "heading",
            Self::YawRate => "yaw rate",
            Self::Depth => "depth",
            Self::Wheels => "wheel speeds",
            Self::Pressure => "pressure",
            Self::PositionSigma => "1σ of position",
            Self::VelocitySigma => "1σ of velocity",
        }
    }
}

impl Kind {
    /// Why a design does not read this kind.
    pub(super) const fn why_unused(self) -> &'static str {
        match self {
            Self::SpecificForce | Self::AngularRate => "another unit or an odometer drives the filter",
            Self::MagneticField => "nothing here needs it",
            Self::Heading => "it does not follow the course, or nothing here needs it",
            Self::Quaternion | Self::Euler => "the estimate of another filter is no measurement",
            Self::Wheels => "a column has the speed itself, or no positions give the radius of the wheels",
            Self::Pressure => "a barometer needs an inertial unit with positions that have a height, and air",
            Self::PositionSigma | Self::VelocitySigma => "rows lack it, the slow error in it is a state, or nothing here needs it",
            Self::Depth => "the positions have one",
            Self::GroundSpeed => "the receiver's own: without a course it is no velocity",
            _ => "this design does not need it",
        }
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
        matches!(self.kind, Kind::PositionSigma | Kind::VelocitySigma) && self.unit.ends_with("^2")
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

/// Standard gravity \[m/s²\].
const GRAVITY: f64 = 9.80665;

/// A nautical mile an hour \[m/s\].
const KNOT: f64 = 1852.0 / 3600.0;

/// SI per unit.
pub(super) fn factor(unit: &str) -> f64 {
    match unit {
        "g" => GRAVITY,
        "mg" => 1e-3 * GRAVITY,
        "deg" | "deg/s" => 1_f64.to_radians(),
        "km/h" => 1.0 / 3.6,
        "kn" => KNOT,
        "ft/s" => 0.3048,
        "cm" | "cm/s" => 1e-2,
        "ms" | "mm" => 1e-3,
        "us" | "uT" => 1e-6,
        "ns" | "nT" => 1e-9,
        "gauss" => 1e-4,
        "mgauss" => 1e-7,
        "hPa" => 100.0,
        "kPa" => 1e3,
        _ => 1.0,
    }
}

/// Words of a quantity that another filter computed from others, or of a setpoint.
const DERIVED: [&str; 11] = [
    "est", "state", "cmd", "odom", "estimate", "kf", "ekf", "setpoint", "sp", "desired", "demanded",
];
/// Words for gyros, and for the angles of an interval.
const GYROS: [&str; 9] = ["w", "g", "gyr", "gyro", "gyroscope", "omega", "rot", "rotation", "rate"];
const ANGULAR_RATE: [&str; 2] = ["angular_velocity", "angular_rate"];
const TURNED: [&str; 7] = ["dth", "dtheta", "dang", "da", "deltatheta", "deltaangle", "delang"];
const DELTA_ANGLE: [&str; 2] = ["delta_angle", "delta_theta"];
/// Words for accelerometers, and for the velocities that an interval adds.
const ACCELEROMETERS: [&str; 7] = ["a", "f", "acc", "accel", "accelerometer", "acceleration", "force"];
const GAINED: [&str; 5] = ["dv", "dvel", "deltav", "deltavelocity", "delvel"];
const DELTA_VELOCITY: [&str; 1] = ["delta_velocity"];

/// Whether the name of a column says that another filter made it.
pub(super) fn is_derived(column: &str) -> bool {
    contains(&Words::of(column).stem, &DERIVED)
}

/// The words for an axis, and whether they mean its opposite.
type Axis = &'static [(&'static str, bool)];

/// The down axis, because most words for axes end with it.
const DOWN: Axis = &[("down", false), ("up", true)];
/// The axes of a body.
const BODY: [Axis; 3] = [
    &[
        ("forward", false),
        ("fwd", false),
        ("front", false),
        ("ahead", false),
        ("backward", true),
        ("back", true),
        ("aft", true),
    ],
    &[("right", false), ("starboard", false), ("left", true), ("port", true)],
    DOWN,
];
/// The axes of the world, in words and in letters.
const WORLD: [[Axis; 3]; 2] = [
    [&[("north", false), ("south", true)], &[("east", false), ("west", true)], DOWN],
    [&[("n", false)], &[("e", false)], &[("d", false), ("u", true)]],
];

struct Finder<'a> {
    table: &'a LogTable,
    words: Vec<Words>,
    found: Vec<Signal>,
}

/// Words of a variance.
const VARIANCE: [&str; 3] = ["var", "variance", "cov"];

/// The quantity whose 1σ or variance a name, or the words before its axis, means.
fn sigma_of(stem: &str) -> Option<Kind> {
    const SIGMA: [&str; 6] = ["sigma", "std", "sd", "stddev", "accuracy", "uncertainty"];
    const VELOCITY: [&str; 4] = ["v", "vel", "velocity", "speed"];
    const POSITION: [&str; 3] = ["p", "pos", "position"];
    match stem {
        "s" | "sd" | "sigma" | "std" | "var" | "variance" => return Some(Kind::PositionSigma),
        "sv" | "sdv" => return Some(Kind::VelocitySigma),
        _ => {}
    }
    let (first, second) = stem.split_once('_')?;
    let is_sigma = |word: &str| SIGMA.contains(&word) || VARIANCE.contains(&word);
    let other = [(first, second), (second, first)].into_iter().find(|(own, _)| is_sigma(own))?.1;
    let of = [(&VELOCITY[..], Kind::VelocitySigma), (&POSITION[..], Kind::PositionSigma)];
    of.into_iter().find(|(words, _)| words.contains(&other)).map(|(_, kind)| kind)
}

/// The 1σ that columns with these names report, from the names alone.
pub(crate) fn reported_by_name(names: &[String]) -> Vec<Reported> {
    let columns = names.iter().map(|name| LogColumn {
        name: name.clone(),
        ..LogColumn::default()
    });
    let table = LogTable {
        columns: columns.collect(),
        ..LogTable::default()
    };
    let mut finder = Finder::of(&table);
    finder.vectors();
    finder.sigmas();
    let is_sigma = |s: &Signal| matches!(s.kind, Kind::PositionSigma | Kind::VelocitySigma);
    let found = finder.found.iter().filter(|s| is_sigma(s));
    found
        .map(|s| Reported {
            kind: s.kind,
            columns: s.names(&table),
            unit: match (s.unit.as_str(), s.kind) {
                ("", Kind::VelocitySigma) => "m/s",
                ("", _) => "m",
                (unit, _) => unit,
            }
            .to_owned(),
        })
        .collect()
}

/// Columns that report a 1σ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reported {
    /// The quantity.
    pub(crate) kind: Kind,
    /// Along north, east and down.
    pub(crate) columns: Vec<String>,
    /// Their unit; for variances, the unit of the variance.
    pub(crate) unit: String,
}

impl Reported {
    /// The channel that reads them, as a design writes it.
    pub(crate) fn channel(&self, axes: usize) -> String {
        let columns: Vec<String> = self.columns.iter().take(axes).map(|name| format!("{name:?}")).collect();
        format!("{{ columns = [{}]{} }}", columns.join(", "), of_unit(&self.unit))
    }
}

/// The unit of columns that report a 1σ, and whether they hold its square.
fn of_unit(unit: &str) -> String {
    let variance = if unit.ends_with("^2") { ", variance = true" } else { "" };
    format!(", unit = \"{unit}\"{variance}")
}

/// The quantities of a table with this row rate.
pub(super) fn signals(table: &LogTable, rate: f64) -> Vec<Signal> {
    let mut finder = Finder::of(table);
    if table.header {
        finder.vectors();
        finder.sigmas();
        finder.over_ground();
        finder.scalars();
        finder.local_with_depth();
    }
    finder.unnamed();
    let mut found = finder.found;
    found.retain(|s| !is_constant(table, s));
    found.iter_mut().for_each(|s| settle(s, table, rate));
    settle_by_turns(&mut found, table, rate);
    found.retain(|s| !is_without_gravity(table, s));
    // Positions that are not on Earth have another unit, such as 1e-7 deg, and a design with them would have no origin.
    found.retain(|s| !(s.kind == Kind::Geodetic && s.unit == "deg" && is_beyond(s, table)));
    found
}

/// Every column has only one value: the quantity was not recorded.
fn is_constant(table: &LogTable, signal: &Signal) -> bool {
    signal.columns.iter().all(|(k, _)| {
        let values = &table.columns[*k].values;
        values.iter().all(|v| !v.is_finite() || *v == values[0])
    })
}

/// Accelerations without gravity, or differences of a velocity: not the measurement of accelerometers.
fn is_without_gravity(table: &LogTable, signal: &Signal) -> bool {
    let is_whole = signal
        .columns
        .iter()
        .all(|(k, _)| table.columns[*k].values.iter().take(1000).all(|v| math::fract(*v) == 0.0));
    signal.kind == Kind::SpecificForce && signal.unit == "counts" && !is_whole
}

impl<'a> Finder<'a> {
    fn of(table: &'a LogTable) -> Self {
        Self {
            table,
            words: table.columns.iter().map(|c| Words::of(c.called())).collect(),
            found: Vec::new(),
        }
    }

    fn add(&mut self, kind: Kind, columns: Vec<(usize, bool)>) {
        if self.found.iter().any(|s| s.kind == kind) {
            return;
        }
        let unit = columns.first().and_then(|(k, _)| self.words[*k].unit);
        self.found.push(Signal {
            kind,
            why: "by name".to_owned(),
            unit: unit.unwrap_or_default().to_owned(),
            factor: 1.0,
            increment: false,
            course: None,
            is_body: false,
            columns,
        });
    }

    /// The columns along three axes, starting with this one, and the words before the axis. A column has the opposite
    /// sign if its word names the opposite direction. The third column may be missing.
    fn along(&self, first: usize, axes: &[Axis; 3]) -> Option<(String, Vec<(usize, bool)>)> {
        let words = &self.words[first];
        let (word, is_against) = axes[0].iter().find(|(word, _)| words.before(word).is_some())?;
        let other = |axis: Axis| axis.iter().find_map(|(to, is)| Some((self.sibling(first, word, to)?, *is)));
        let columns = [Some((first, *is_against)), Some(other(axes[1])?), other(axes[2])];
        Some((words.before(word)?.to_owned(), columns.into_iter().flatten().collect()))
    }

    /// The column with the same prefix and another axis, joined in the same way.
    fn sibling(&self, first: usize, from: &str, to: &str) -> Option<usize> {
        let stem = self.words[first].stem.strip_suffix(from)?;
        let wanted = format!("{stem}{to}");
        self.words.iter().position(|w| w.stem == wanted)
    }

    fn vectors(&mut self) {
        for k in 0..self.words.len() {
            let Words { stem, unit } = self.words[k].clone();
            if contains(&stem, &DERIVED) {
                continue;
            }
            if let (Some(prefix), Some(y), Some(z)) = (self.words[k].before("x"), self.sibling(k, "x", "y"), self.sibling(k, "x", "z")) {
                let prefix = prefix.to_owned();
                self.axes_xyz(&prefix, unit, &[(k, false), (y, false), (z, false)]);
            }
            if let Some((prefix, columns)) = self.along(k, &BODY).filter(|(_, columns)| columns.len() == 3) {
                self.axes_xyz(&prefix, unit, &columns);
                if let Some(found) = self.found.last_mut().filter(|s| s.columns == columns) {
                    found.is_body = true;
                    found.why = "by name: forward, right, down".to_owned();
                }
            }
            for axes in &WORLD {
                if let Some((prefix, columns)) = self.along(k, axes) {
                    self.axes_ned(&prefix, unit, columns);
                }
            }
            if let (Some("v"), Some(l)) = (self.words[k].before("f"), self.sibling(k, "f", "l")) {
                let up = self.sibling(k, "f", "u").map(|u| (u, true));
                self.add(
                    Kind::BodyVelocity,
                    [Some((k, false)), Some((l, true)), up].into_iter().flatten().collect(),
                );
            }
            if let (Some("w" | "wheel" | "v" | "track"), Some(r)) = (self.words[k].before("l"), self.sibling(k, "l", "r"))
                && self.sibling(k, "l", "f").is_none()
            {
                self.add(Kind::Wheels, vec![(k, false), (r, false)]);
            }
        }
    }

    /// A vector in axes of a body, or of a room; `columns` are along these axes.
    fn axes_xyz(&mut self, prefix: &str, unit: Option<&str>, columns: &[(usize, bool)]) {
        let (plain, x) = (columns.to_vec(), columns[0].0);
        if let Some(w) = self
            .sibling(x, "x", "w")
            .filter(|_| is_called(prefix, &QUATERNION) || (prefix.is_empty() && self.is_file_called(&QUATERNION)))
        {
            let all = [&[(w, false)], columns].concat();
            return self.add(Kind::Quaternion, all);
        }
        const FIELD: [&str; 4] = ["m", "mag", "magnetometer", "magnetic"];
        // G may mean gauss.
        let gauss = match unit {
            Some("g") if is_called(prefix, &FIELD) => Some("gauss"),
            Some("mg") if is_called(prefix, &FIELD) => Some("mgauss"),
            _ => None,
        };
        let turned = is_called(prefix, &TURNED) || is_phrase(prefix, &DELTA_ANGLE);
        let gained = is_called(prefix, &GAINED) || is_phrase(prefix, &DELTA_VELOCITY);
        let gyros = is_called(prefix, &GYROS) || is_phrase(prefix, &ANGULAR_RATE);
        let kind = match unit {
            _ if gauss.is_some() => Some(Kind::MagneticField),
            None if turned => Some(Kind::AngularRate),
            None if gained => Some(Kind::SpecificForce),
            Some("m/s^2" | "g" | "mg") => Some(Kind::SpecificForce),
            Some("uT" | "nT" | "T" | "gauss") => Some(Kind::MagneticField),
            Some("m/s") if gained => Some(Kind::SpecificForce),
            Some("m/s") if is_called(prefix, &["v", "vel", "velocity", "body_velocity"]) => Some(Kind::BodyVelocity),
            Some("rad" | "deg") if turned || gyros => Some(Kind::AngularRate),
            Some("rad/s" | "deg/s") => Some(Kind::AngularRate),
            Some("m") if prefix.is_empty() || is_called(prefix, &["p", "pos", "position"]) => Some(Kind::Local),
            Some("counts") | None if is_called(prefix, &ACCELEROMETERS) => Some(Kind::SpecificForce),
            Some("counts") | None if gyros => Some(Kind::AngularRate),
            None if is_called(prefix, &FIELD) => Some(Kind::MagneticField),
            _ => None,
        };
        match kind {
            // Metres x, y, z of a room or a map: taken as east, north, up.
            Some(Kind::Local) => self.add(Kind::Local, vec![plain[1], plain[0], (plain[2].0, !plain[2].1)]),
            Some(kind) => self.add(kind, plain),
            None => {}
        }
        if let Some(found) = self.found.last_mut().filter(|s| s.columns.iter().any(|c| c.0 == x)) {
            if let Some(gauss) = gauss {
                found.unit = gauss.to_owned();
            }
            match found.kind {
                Kind::Local => found.why = "by name: x, y, z as east, north, up".to_owned(),
                Kind::BodyVelocity => found.why = "by name: x, y, z as forward, right, down".to_owned(),
                _ => {}
            }
            found.increment = match (found.kind, unit) {
                (Kind::SpecificForce, Some("m/s")) => true,
                (Kind::AngularRate, Some("rad" | "deg")) => turned,
                (Kind::SpecificForce, None) => gained,
                (Kind::AngularRate, None) => turned,
                _ => false,
            };
            match (found.kind, unit) {
                // `gyro_rad` of PX4 is a rate.
                (Kind::AngularRate, Some("rad")) if !turned => found.unit = "rad/s".to_owned(),
                (Kind::AngularRate, Some("deg")) if !turned => found.unit = "deg/s".to_owned(),
                (Kind::AngularRate, None) if turned => found.unit = "rad".to_owned(),
                _ => {}
            }
        }
    }

    /// A vector north, east, down.
    fn axes_ned(&mut self, prefix: &str, unit: Option<&str>, columns: Vec<(usize, bool)>) {
        let is_velocity = prefix == "v" || is_called(prefix, &["vel", "velocity"]);
        // A velocity may have no vertical part.
        if columns.len() < 3 && !(is_velocity && matches!(unit, None | Some("m/s" | "cm/s" | "km/h" | "kn"))) {
            return;
        }
        if let Some(kind) = sigma_of(prefix) {
            // A 1σ has no direction: up and down are the same.
            return self.add_sigma(kind, columns.into_iter().map(|(k, _)| k).collect());
        }
        match (prefix, unit) {
            ("", Some("m/s" | "cm/s" | "km/h")) => self.add(Kind::Velocity, columns),
            _ if is_velocity => self.add(Kind::Velocity, columns),
            ("" | "p", None | Some("m" | "cm" | "mm")) => self.add(Kind::Local, columns),
            (_, None | Some("m" | "cm" | "mm")) if is_called(prefix, &["pos", "position"]) => self.add(Kind::Local, columns),
            _ => {}
        }
    }

    /// The 1σ of all axes in one column. Its name has to give the unit: without it, millimetres and metres look alike.
    fn sigmas(&mut self) {
        for k in 0..self.words.len() {
            let Words { stem, unit } = &self.words[k];
            let kind = if ["sacc", "s_acc"].contains(&stem.as_str()) {
                Some(Kind::VelocitySigma)
            } else {
                // A single word may mean anything.
                sigma_of(stem).filter(|_| stem.contains('_'))
            };
            let expected = match kind {
                Some(Kind::VelocitySigma) => ["m/s", "cm/s", "km/h"],
                _ => ["m", "cm", "mm"],
            };
            if let Some(kind) = kind.filter(|_| unit.is_some_and(|unit| expected.contains(&unit)) && !contains(stem, &DERIVED)) {
                self.add_sigma(kind, vec![k; 3]);
            }
        }
    }

    fn add_sigma(&mut self, kind: Kind, columns: Vec<usize>) {
        let is_variance = contains(&self.words[columns[0]].stem, &VARIANCE);
        self.add(kind, columns.into_iter().map(|k| (k, false)).collect());
        if let Some(found) = self.found.last_mut().filter(|s| s.kind == kind && is_variance && s.unit.is_empty()) {
            found.unit = if kind == Kind::PositionSigma { "m^2" } else { "m^2/s^2" }.to_owned();
        }
    }

    /// Whether the topic, or else the file, has one of these words in its name.
    fn is_file_called(&self, words: &[&str]) -> bool {
        let stem = || self.table.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = self.table.topic.as_ref().map_or_else(stem, |topic| topic.name.clone());
        is_called(&Words::of(&name).stem, words)
    }

    fn one(&self, names: &[&str]) -> Option<usize> {
        self.words.iter().position(|w| w.ends_with(names) && !contains(&w.stem, &DERIVED))
    }

    /// Speed and course of a receiver, with a vertical speed if there is one. A speed in the rows of its positions
    /// belongs to the receiver.
    fn over_ground(&mut self) {
        const COURSE: [&str; 9] = [
            "cog",
            "course",
            "course_over_ground",
            "courseoverground",
            "gcrs",
            "bearing",
            "track",
            "trk",
            "track_angle",
        ];
        const OWN: [&str; 6] = [
            "sog",
            "speed_over_ground",
            "speedoverground",
            "ground_speed",
            "groundspeed",
            "gspeed",
        ];
        let is_called = |k: &usize, names: &[&str]| {
            let w = &self.words[*k];
            w.ends_with(names) && !contains(&w.stem, &DERIVED)
        };
        let is_speed = |k: &usize| matches!(self.words[*k].unit, None | Some("m/s" | "cm/s" | "km/h" | "kn"));
        let is_angle = |k: &usize| matches!(self.words[*k].unit, None | Some("deg" | "rad"));
        let mut columns = 0..self.words.len();
        let own = columns.clone().find(|k| is_speed(k) && is_called(k, &OWN));
        let any = || {
            columns
                .clone()
                .find(|k| is_speed(k) && is_called(k, &["speed", "spd"]) && self.is_of_fixes(*k))
        };
        let Some(speed) = own.or_else(any) else { return };
        let Some(course) = columns.find(|k| is_angle(k) && is_called(k, &COURSE)) else {
            return self.add(Kind::GroundSpeed, vec![(speed, false)]);
        };
        if self.found.iter().any(|s| s.kind == Kind::Velocity) {
            return self.add(Kind::GroundSpeed, vec![(speed, false)]);
        }
        const VERTICAL: [(&str, bool); 6] = [
            ("vz", false),
            ("vd", false),
            ("vel_d", false),
            ("veld", false),
            ("vu", true),
            ("vel_u", true),
        ];
        let named = |name: &str| self.words.iter().position(|w| w.stem == name);
        let vertical = VERTICAL.iter().find_map(|(name, is_up)| Some((named(name)?, *is_up)));
        let used = |k: usize| self.found.iter().any(|s| s.columns.iter().any(|c| c.0 == k));
        let vertical = vertical.filter(|(k, _)| !used(*k));
        self.add(
            Kind::Velocity,
            [(speed, false), (course, false)].into_iter().chain(vertical).collect(),
        );
        let reach = quantile(self.table.columns[course].values.iter().map(|v| v.abs()), 0.99);
        let by_values = if reach > core::f64::consts::TAU { "deg" } else { "rad" };
        let unit = self.words[course].unit.unwrap_or(by_values);
        if let Some(found) = self.found.last_mut().filter(|s| s.kind == Kind::Velocity) {
            found.course = Some(unit);
            found.why = "by name: speed and course".to_owned();
        }
    }

    /// Whether a column is in the rows of positions and changes with them: an additional output of the receiver.
    fn is_of_fixes(&self, column: usize) -> bool {
        /// This share of the rows in which it changes also has a new position.
        const WITH: f64 = 0.8;
        let (Some(lat), Some(lon)) = (self.one(&["lat", "latitude"]), self.one(&["lon", "lng", "long", "longitude"])) else {
            return false;
        };
        let values = |k: usize| &self.table.columns[k].values;
        let rows: Vec<usize> = (0..self.table.rows()).filter(|row| values(column)[*row].is_finite()).collect();
        let changes = rows.windows(2).filter(|w| values(column)[w[0]] != values(column)[w[1]]);
        let (mut all, mut with) = (0.0, 0.0);
        for w in changes {
            all += 1.0;
            let is_new = [lat, lon]
                .iter()
                .any(|k| values(*k)[w[1]].is_finite() && values(*k)[w[0]] != values(*k)[w[1]]);
            with += f64::from(u8::from(is_new));
        }
        all > 0.0 && with > WITH * all
    }

    /// A height whose name may also give its datum. Of two, the height above the ellipsoid, as for latitudes and
    /// longitudes.
    fn height(&self) -> Option<usize> {
        let is_in_metres = |k: &usize| matches!(self.words[*k].unit, None | Some("m"));
        let all = (0..self.words.len()).filter(|k| is_in_metres(k) && is_height(&self.words[*k].stem));
        all.min_by_key(|k| ["msl", "sea"].iter().any(|datum| self.words[*k].stem.contains(datum)))
    }

    fn scalars(&mut self) {
        if let (Some(lat), Some(lon)) = (self.one(&["lat", "latitude"]), self.one(&["lon", "lng", "long", "longitude"])) {
            let height = self.one(&["h", "alt", "height", "altitude"]).or_else(|| self.height());
            let columns = [Some(lat), Some(lon), height].into_iter().flatten();
            self.add(Kind::Geodetic, columns.map(|k| (k, false)).collect());
        }
        if let (Some(r), Some(p), Some(y)) = (self.one(&["roll"]), self.one(&["pitch"]), self.one(&["yaw", "heading"])) {
            self.add(Kind::Euler, vec![(r, false), (p, false), (y, false)]);
        } else if let Some(heading) = self.one(&[
            "heading",
            "yaw",
            "hdg",
            "hdt",
            "heading_t",
            "heading_true",
            "headingtrue",
            "true_heading",
        ]) {
            self.add(Kind::Heading, vec![(heading, false)]);
        }
        let singles: [(Kind, &[&str]); 4] = [
            (Kind::Speed, &["v", "speed", "stw", "speed_through_water"]),
            (Kind::YawRate, &["yawrate", "yaw_rate"]),
            (Kind::Depth, &["depth"]),
            (Kind::Pressure, &["pressure", "press", "baro", "p_baro", "barometer"]),
        ];
        for (kind, names) in singles {
            let is_free = |k: &usize| !self.found.iter().any(|s| s.columns.iter().any(|c| c.0 == *k));
            if let Some(k) = self.one(names).filter(is_free) {
                self.add(kind, vec![(k, false)]);
            }
        }
    }

    /// x and y next to a depth: metres east and north.
    fn local_with_depth(&mut self) {
        let Some(depth) = self.found.iter().find(|s| s.kind == Kind::Depth).map(|s| s.columns[0].0) else {
            return;
        };
        let is_fix = |w: &Words| !contains(&w.stem, &DERIVED) && contains(&w.stem, &["usbl", "pos", "p", "fix"]);
        let x = (0..self.words.len()).find(|k| is_fix(&self.words[*k]) && self.words[*k].before("x").is_some());
        if let Some((x, y)) = x.and_then(|x| Some((x, self.sibling(x, "x", "y")?))) {
            self.add(Kind::Local, vec![(y, false), (x, false), (depth, false)]);
            if let Some(found) = self.found.last_mut().filter(|s| s.kind == Kind::Local) {
                found.why = "by name: x, y as east, north".to_owned();
            }
        }
    }

    /// Finds an inertial unit if no name gives it. Three neighbouring columns whose length is one g most of the time
    /// are the accelerometers. Three neighbouring columns next to them, with a small mean against their range, are the
    /// gyros.
    fn unnamed(&mut self) {
        let named = |kind: Kind| self.found.iter().find(|s| s.kind == kind).map(|s| s.columns[0].0);
        let (force, rate) = (named(Kind::SpecificForce), named(Kind::AngularRate));
        if force.is_some() && rate.is_some() {
            return;
        }
        let used: Vec<usize> = self.found.iter().flat_map(|s| s.columns.iter().map(|c| c.0)).collect();
        let values = |k: usize| self.table.columns[k].values.iter().copied();
        let is_free = |k: usize| !used.contains(&k) && values(k).zip(values(k).skip(1)).any(|(a, b)| a < b);
        let starts: Vec<usize> = (0..self.table.columns.len().saturating_sub(2))
            .filter(|start| (*start..start + 3).all(is_free))
            .collect();
        let length = |k: usize, row: usize| norm([0, 1, 2].map(|i| self.table.columns[k + i].values[row]));
        let is_gravity = |k: &usize| {
            let m = median((0..self.table.rows()).map(|row| length(*k, row)));
            (9.6..10.0).contains(&m) || (0.98..1.02).contains(&m) || (980.0..1020.0).contains(&m)
        };
        let is_around_zero = |k: usize| quantile(values(k), 0.02) < 0.0 && quantile(values(k), 0.98) > 0.0;
        let beside = |a: usize| [a.checked_sub(3), Some(a + 3)].into_iter().flatten();
        let gyro = |a: usize| beside(a).filter(|k| starts.contains(k)).find(|k| (*k..k + 3).all(is_around_zero));
        let found = match (force, rate) {
            // If one of both has a name, the other has to be next to it.
            (Some(force), _) => gyro(force).map(|g| (None, Some(g))),
            (None, Some(rate)) => beside(rate).find(|k| starts.contains(k) && is_gravity(k)).map(|a| (Some(a), None)),
            // If columns have names, numbers near one may be anything: the gyros have to be next to them.
            (None, None) => {
                let unit = starts.iter().filter(|k| is_gravity(k)).map(|a| (Some(*a), gyro(*a)));
                unit.into_iter().find(|(_, gyro)| gyro.is_some() || !self.table.header)
            }
        };
        let Some((force, gyro)) = found else { return };
        let known = self.found.len();
        for (kind, first) in [(Kind::SpecificForce, force), (Kind::AngularRate, gyro)] {
            if let Some(first) = first {
                self.add(kind, (first..first + 3).map(|k| (k, false)).collect());
            }
        }
        self.found[known..].iter_mut().for_each(|s| s.why = "by its values".to_owned());
    }
}

/// Finds the unit and factor of a signal, from its name or its values.
fn settle(signal: &mut Signal, table: &LogTable, rate: f64) {
    if let Some((unit, why)) = unit_by_values(signal, table, rate) {
        signal.why = format!("{}; {unit}: {why}", signal.why);
        signal.unit = unit.to_owned();
    }
    signal.factor = match (signal.kind, signal.unit.as_str()) {
        (Kind::SpecificForce, "counts") => GRAVITY / length(signal, table, 0.5),
        (_, unit) => factor(unit),
    };
}

/// Finds the unit of gyros without a named unit, from the turns of the magnetic field or of gravity. Hands turn a unit
/// faster than 10 rad/s, and vehicles turn slower than 10 deg/s, so the size alone does not show it.
fn settle_by_turns(found: &mut [Signal], table: &LogTable, rate: f64) {
    /// In this time, hands turn a unit by only a small angle [s].
    const STEP: f64 = 0.1;
    // Accelerations do not turn the field.
    let directions = [(Kind::MagneticField, "the field"), (Kind::SpecificForce, "gravity")].map(|(kind, name)| {
        let signal = found.iter().find(|s| s.kind == kind && !s.increment);
        signal.map(|s| (s.values(table), name))
    });
    let gyros = found.iter_mut().find(|s| s.kind == Kind::AngularRate && !s.increment);
    let is_named = |s: &Signal| Words::of(table.columns[s.columns[0].0].called()).unit.is_some();
    let Some(gyros) = gyros.filter(|s| !is_named(s)) else { return };
    let raw: Vec<Vec3> = (0..table.rows()).map(|row| gyros.raw(table, row)).collect();
    let told = directions.iter().flatten();
    let mut slopes = told.filter_map(|(direction, name)| Some((turn::slope(direction, &raw, rate, STEP)?, *name)));
    let Some((slope, what)) = slopes.next() else { return };
    let (radians, degrees) = (1.0, 1_f64.to_radians());
    // The threshold is half-way between the two on a logarithmic scale.
    let unit = if slope > math::sqrt(radians * degrees) { "rad/s" } else { "deg/s" };
    if math::ln(slope / factor(unit)).abs() < math::ln(2_f64) {
        gyros.unit = unit.to_owned();
        gyros.factor = factor(unit);
        let found = gyros.why.split(';').next().unwrap_or_default().to_owned();
        gyros.why = format!("{found}; {unit}: {what} turns by {:.2} of what they say", slope / gyros.factor);
    }
}

/// No vehicle here is faster than sound \[m/s\].
const FASTEST: f64 = 340.0;

/// The median speed by positions with angles in rad, corrected for the rows that do not change \[m/s\].
fn usual_speed(s: &Signal, table: &LogTable, rate: f64) -> f64 {
    const RADIUS: f64 = 6.371e6;
    let place = |row: usize| s.raw(table, row);
    let is_fix = |p: &Vec3| p[..2] != [0.0, 0.0];
    let steps = (1..table.rows()).filter_map(|row| {
        let (a, b) = (place(row - 1), place(row));
        let step = math::hypot(b[0] - a[0], (b[1] - a[1]) * math::cos(a[0]));
        (step > 0.0 && is_fix(&a) && is_fix(&b)).then_some(step)
    });
    // A fix that is repeated in several rows moves once in several intervals. The share of rows that change corrects
    // for it.
    let changes = (1..table.rows()).filter(|row| place(*row)[..2] != place(*row - 1)[..2]).count() as f64;
    RADIUS * quantile(steps, 0.5) * rate * changes / table.rows().max(1) as f64
}

/// Returns true if angles are degrees and minutes in one number, as NMEA writes them: larger than any degrees, with
/// minutes below 60.
fn is_ddmm(s: &Signal, table: &LogTable) -> bool {
    let angles = || {
        (0..table.rows())
            .map(|row| s.raw(table, row))
            .filter(|v| v[0].is_finite() && v[1].is_finite())
    };
    matches!(s.unit.as_str(), "" | "deg")
        && is_beyond(s, table)
        && angles().all(|v| v[0].abs() <= 9000.0 && v[1].abs() <= 18_000.0 && v[..2].iter().all(|x| x.abs() % 100.0 < 60.0))
}

/// Returns true if angles in degrees would be beyond 90 or 360 in more than a hundredth of the rows.
fn is_beyond(s: &Signal, table: &LogTable) -> bool {
    let reach = |axis: usize| quantile((0..table.rows()).map(|row| s.raw(table, row)[axis].abs()), 0.99);
    reach(0) > 90.0 || reach(1) > 360.0
}

/// Degrees and minutes in one number as rad.
fn of_ddmm(x: f64) -> f64 {
    let degrees = math::trunc(x / 100.0);
    (degrees + (x - 100.0 * degrees) / 60.0).to_radians()
}

/// The length of a vector that this share of the rows stays below, in the unit of its columns.
fn length(signal: &Signal, table: &LogTable, share: f64) -> f64 {
    quantile((0..table.rows()).map(|row| norm(signal.raw(table, row))), share)
}

/// The unit that the values suggest, and the reason; `None` if the name gives it.
fn unit_by_values(s: &Signal, table: &LogTable, rate: f64) -> Option<(&'static str, String)> {
    let reach = |axis: usize| quantile((0..table.rows()).map(|row| s.raw(table, row)[axis].abs()), 0.99);
    if s.kind == Kind::SpecificForce && s.increment {
        let m = length(s, table, 0.5) * rate;
        return Some(("m/s", format!("increments, median length × {rate:.0} Hz = {m:.2}")));
    }
    if s.kind == Kind::Geodetic && is_ddmm(s, table) {
        return Some(("ddmm", format!("latitudes reach {:.3}, minutes are below 60", reach(0))));
    }
    if !matches!(s.unit.as_str(), "" | "counts") {
        return None;
    }
    Some(match s.kind {
        Kind::SpecificForce => match length(s, table, 0.5) {
            m if (9.0..10.6).contains(&m) => ("m/s^2", format!("median length {m:.2}")),
            m if (0.9..1.1).contains(&m) => ("g", format!("median length {m:.3}")),
            m if (900.0..1100.0).contains(&m) => ("mg", format!("median length {m:.0}")),
            m => ("counts", format!("median length {m:.1}, taken as one g")),
        },
        Kind::AngularRate if s.unit == "counts" => return None,
        Kind::AngularRate => match length(s, table, 0.99) {
            p if p > 10.0 => ("deg/s", format!("99 % are within {p:.1}: more than 10 rad/s is rare")),
            p => ("rad/s", format!("99 % are within {p:.2}")),
        },
        // The Earth's field is 22 to 67 uT; iron adds to it.
        Kind::MagneticField => match length(s, table, 0.5) {
            m if (15.0..120.0).contains(&m) => ("uT", format!("median length {m:.1}")),
            m if (15e-6..120e-6).contains(&m) => ("T", format!("median length {m:.2e}")),
            m if (15e3..120e3).contains(&m) => ("nT", format!("median length {m:.0}")),
            // Less than one: a field that is given as a direction has length one.
            m if (0.15..0.8).contains(&m) => ("gauss", format!("median length {m:.3}")),
            m if (150.0..800.0).contains(&m) => ("mgauss", format!("median length {m:.0}")),
            _ => return None,
        },
        Kind::Geodetic if reach(0) > core::f64::consts::FRAC_PI_2 => ("deg", format!("latitudes reach {:.3}", reach(0))),
        Kind::Geodetic if reach(1) > core::f64::consts::PI => ("deg", format!("longitudes reach {:.3}", reach(1))),
        Kind::Geodetic if usual_speed(s, table, rate) > FASTEST => ("deg", "in rad it would be faster than sound".to_owned()),
        Kind::Geodetic => ("rad", format!("longitudes reach {:.4}", reach(1))),
        Kind::Euler if reach(2) > core::f64::consts::TAU => ("deg", format!("headings reach {:.1}", reach(2))),
        Kind::Euler => ("rad", format!("headings reach {:.2}", reach(2))),
        Kind::Heading if reach(0) > core::f64::consts::TAU => ("deg", format!("headings reach {:.1}", reach(0))),
        Kind::Heading => ("rad", format!("headings reach {:.2}", reach(0))),
        Kind::YawRate => match reach(0) {
            p if p > 10.0 => ("deg/s", format!("99 % are within {p:.1}: more than 10 rad/s is rare")),
            p => ("rad/s", format!("99 % are within {p:.2}")),
        },
        // No place with people has less than a third of the sea-level pressure.
        Kind::Pressure => match length(s, table, 0.5) {
            m if (3e4..1.2e5).contains(&m) => ("Pa", format!("median {m:.0}")),
            m if (300.0..1200.0).contains(&m) => ("hPa", format!("median {m:.1}")),
            m if (30.0..120.0).contains(&m) => ("kPa", format!("median {m:.2}")),
            _ => return None,
        },
        Kind::Local | Kind::Depth | Kind::PositionSigma => ("m", UNNAMED.to_owned()),
        Kind::Velocity | Kind::BodyVelocity | Kind::Speed | Kind::GroundSpeed | Kind::VelocitySigma => ("m/s", UNNAMED.to_owned()),
        _ => return None,
    })
}
