//! Which columns of a table are which quantity.

use super::numbers::{Vec3, median, norm, quantile};
use super::turn;
use super::words::{Words, contains, is_called};
use crate::source::table::Table;

/// A quantity that a filter can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// What accelerometers measure.
    SpecificForce,
    /// What gyros measure.
    AngularRate,
    /// The magnetic field in sensor axes.
    MagneticField,
    /// Latitude, longitude and, where there is one, height.
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
    /// Rate of turn.
    YawRate,
    /// Below the surface.
    Depth,
    /// Speeds of the left and the right wheels or tracks.
    Wheels,
    /// Of the air or the water.
    Pressure,
    /// 1σ of the position, as reported.
    PositionSigma,
    /// 1σ of the velocity, as reported.
    VelocitySigma,
}

impl Kind {
    /// In words.
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
    /// Why a design does not read one.
    pub(super) const fn why_unused(self) -> &'static str {
        match self {
            Self::SpecificForce | Self::AngularRate => "another unit or an odometer drives the filter",
            Self::MagneticField => "its iron is not known: add a stage `compass` once it is calibrated",
            Self::Quaternion | Self::Euler => "the estimate of another filter is no measurement",
            Self::Wheels => "an odometer takes one speed: add a column with the mean of both",
            Self::Pressure => "a barometer needs an inertial unit with positions that have a height, and air",
            Self::PositionSigma | Self::VelocitySigma => "the noise is one number in a first design",
            Self::Depth => "the positions have one",
            _ => "this design does not need it",
        }
    }
}

/// A quantity in a table.
#[derive(Clone, Debug)]
pub struct Signal {
    /// Which.
    pub kind: Kind,
    /// Its columns in the sequence of the kind, and whether they count against it.
    pub columns: Vec<(usize, bool)>,
    /// The unit as designs write it; empty where none is known.
    pub unit: String,
    /// SI per unit of the columns.
    pub factor: f64,
    /// Increments over the interval between rows.
    pub increment: bool,
    /// Why it is believed.
    pub why: String,
}

impl Signal {
    /// The columns as a design names them.
    #[must_use]
    pub fn names(&self, table: &Table) -> Vec<String> {
        let name = |(k, is_against): &(usize, bool)| {
            let sign = if *is_against { "-" } else { "" };
            format!("{sign}{}", table.columns[*k].name)
        };
        self.columns.iter().map(name).collect()
    }

    /// The value of a row, not yet in SI; missing axes are zero.
    pub(super) fn raw(&self, table: &Table, row: usize) -> Vec3 {
        [0, 1, 2].map(|axis| {
            self.columns.get(axis).map_or(0.0, |(k, is_against)| {
                let v = table.columns[*k].values[row];
                if *is_against { -v } else { v }
            })
        })
    }

    /// All values in SI; increments stay increments.
    pub(super) fn values(&self, table: &Table) -> Vec<Vec3> {
        (0..table.rows()).map(|row| self.raw(table, row).map(|v| v * self.factor)).collect()
    }
}

/// Standard gravity \[m/s²\].
const GRAVITY: f64 = 9.80665;

/// SI per unit.
pub(super) fn factor(unit: &str) -> f64 {
    match unit {
        "g" => GRAVITY,
        "mg" => 1e-3 * GRAVITY,
        "deg" | "deg/s" => 1_f64.to_radians(),
        "km/h" => 1.0 / 3.6,
        "ms" => 1e-3,
        "us" | "uT" => 1e-6,
        "ns" | "nT" => 1e-9,
        "gauss" => 1e-4,
        "mgauss" => 1e-7,
        "hPa" => 100.0,
        "kPa" => 1e3,
        _ => 1.0,
    }
}

/// Words of a quantity that was computed from others, by somebody else's filter.
const DERIVED: [&str; 7] = ["est", "state", "cmd", "odom", "estimate", "kf", "ekf"];

/// Whether the name of a column says that another filter made it.
pub(super) fn is_derived(column: &str) -> bool {
    contains(&Words::of(column).stem, &DERIVED)
}

struct Finder<'a> {
    table: &'a Table,
    words: Vec<Words>,
    found: Vec<Signal>,
}

/// The quantities of a table whose rows come at `rate`.
pub(super) fn signals(table: &Table, rate: f64) -> Vec<Signal> {
    let words: Vec<Words> = table.columns.iter().map(|c| Words::of(c.called())).collect();
    let mut finder = Finder {
        table,
        words,
        found: Vec::new(),
    };
    if table.header {
        finder.vectors();
        finder.scalars();
        finder.local_with_depth();
    } else {
        finder.unnamed();
    }
    let mut found = finder.found;
    found.retain(|s| !is_constant(table, s));
    found.iter_mut().for_each(|s| settle(s, table, rate));
    settle_by_turns(&mut found, table, rate);
    found.retain(|s| !is_without_gravity(table, s));
    found
}

/// Nothing but one value in every column: not recorded.
fn is_constant(table: &Table, signal: &Signal) -> bool {
    signal.columns.iter().all(|(k, _)| {
        let values = &table.columns[*k].values;
        values.iter().all(|v| !v.is_finite() || *v == values[0])
    })
}

/// Accelerations from which gravity was taken, or differences of a velocity: not what accelerometers measure.
fn is_without_gravity(table: &Table, signal: &Signal) -> bool {
    let is_whole = signal
        .columns
        .iter()
        .all(|(k, _)| table.columns[*k].values.iter().take(1000).all(|v| v.fract() == 0.0));
    signal.kind == Kind::SpecificForce && signal.unit == "counts" && !is_whole
}

impl Finder<'_> {
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
            columns,
        });
    }

    /// The column whose stem is `prefix` and an axis, joined as in the first one.
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
                self.axes_xyz(&prefix, unit, [k, y, z]);
            }
            for [n, e, d, u] in [["n", "e", "d", "u"], ["north", "east", "down", "up"]] {
                if let (Some(prefix), Some(east)) = (self.words[k].before(n), self.sibling(k, n, e)) {
                    let prefix = prefix.to_owned();
                    let down = self.sibling(k, n, d).map(|d| (d, false));
                    let down = down.or_else(|| self.sibling(k, n, u).map(|u| (u, true)));
                    self.axes_ned(&prefix, k, east, down);
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

    fn axes_xyz(&mut self, prefix: &str, unit: Option<&str>, [x, y, z]: [usize; 3]) {
        let plain = vec![(x, false), (y, false), (z, false)];
        if let Some(w) = self
            .sibling(x, "x", "w")
            .filter(|_| is_called(prefix, &["q", "quat", "quaternion", "orientation", "attitude"]))
        {
            return self.add(Kind::Quaternion, vec![(w, false), (x, false), (y, false), (z, false)]);
        }
        const FIELD: [&str; 4] = ["m", "mag", "magnetometer", "magnetic"];
        // A G may be a gauss.
        let gauss = match unit {
            Some("g") if is_called(prefix, &FIELD) => Some("gauss"),
            Some("mg") if is_called(prefix, &FIELD) => Some("mgauss"),
            _ => None,
        };
        let kind = match unit {
            _ if gauss.is_some() => Some(Kind::MagneticField),
            Some("m/s^2" | "g" | "mg") => Some(Kind::SpecificForce),
            Some("uT" | "nT" | "T") => Some(Kind::MagneticField),
            Some("m/s") if is_called(prefix, &["dv", "dvel", "deltav"]) => Some(Kind::SpecificForce),
            Some("m/s") if is_called(prefix, &["v", "vel", "body_velocity"]) => Some(Kind::BodyVelocity),
            Some("rad" | "deg") if is_called(prefix, &["dth", "dtheta", "dang", "da"]) => Some(Kind::AngularRate),
            Some("rad/s" | "deg/s") => Some(Kind::AngularRate),
            Some("m") if prefix.is_empty() || is_called(prefix, &["p", "pos", "position"]) => Some(Kind::Local),
            Some("counts") | None if is_called(prefix, &["a", "f", "acc", "accel", "accelerometer", "acceleration"]) => {
                Some(Kind::SpecificForce)
            }
            Some("counts") | None if is_called(prefix, &["w", "g", "gyr", "gyro", "gyroscope", "omega"]) => Some(Kind::AngularRate),
            None if is_called(prefix, &FIELD) => Some(Kind::MagneticField),
            _ => None,
        };
        match kind {
            // Metres x, y, z of a room or a map: taken as east, north, up.
            Some(Kind::Local) => self.add(Kind::Local, vec![(y, false), (x, false), (z, true)]),
            Some(kind) => self.add(kind, plain),
            None => {}
        }
        if let Some(found) = self.found.last_mut().filter(|s| s.columns[0].0 == x) {
            if let Some(gauss) = gauss {
                found.unit = gauss.to_owned();
            }
            found.increment = matches!(
                (found.kind, unit),
                (Kind::SpecificForce, Some("m/s")) | (Kind::AngularRate, Some("rad" | "deg"))
            );
        }
    }

    fn axes_ned(&mut self, prefix: &str, n: usize, e: usize, down: Option<(usize, bool)>) {
        let Some(down) = down else { return };
        let kind = match prefix {
            "v" | "vel" | "velocity" => Kind::Velocity,
            // A 1σ has no direction: up is as good as down.
            "s" | "sd" | "sigma" | "std" => return self.add(Kind::PositionSigma, vec![(n, false), (e, false), (down.0, false)]),
            "sv" | "sdv" => return self.add(Kind::VelocitySigma, vec![(n, false), (e, false), (down.0, false)]),
            _ => return,
        };
        self.add(kind, vec![(n, false), (e, false), down]);
    }

    fn one(&self, names: &[&str]) -> Option<usize> {
        self.words.iter().position(|w| w.ends_with(names) && !contains(&w.stem, &DERIVED))
    }

    fn scalars(&mut self) {
        if let (Some(lat), Some(lon)) = (self.one(&["lat", "latitude"]), self.one(&["lon", "lng", "long", "longitude"])) {
            let height = self.one(&["h", "alt", "height", "altitude"]);
            let columns = [Some(lat), Some(lon), height].into_iter().flatten();
            self.add(Kind::Geodetic, columns.map(|k| (k, false)).collect());
        }
        if let (Some(r), Some(p), Some(y)) = (self.one(&["roll"]), self.one(&["pitch"]), self.one(&["yaw", "heading"])) {
            self.add(Kind::Euler, vec![(r, false), (p, false), (y, false)]);
        }
        let singles: [(Kind, &[&str]); 4] = [
            (Kind::Speed, &["v", "speed", "stw"]),
            (Kind::YawRate, &["yawrate", "yaw_rate"]),
            (Kind::Depth, &["depth"]),
            (Kind::Pressure, &["pressure", "press", "baro", "p_baro"]),
        ];
        for (kind, names) in singles {
            if let Some(k) = self.one(names) {
                self.add(kind, vec![(k, false)]);
            }
        }
    }

    /// x and y beside a depth: metres east and north.
    fn local_with_depth(&mut self) {
        let Some(depth) = self.found.iter().find(|s| s.kind == Kind::Depth).map(|s| s.columns[0].0) else {
            return;
        };
        let is_fix = |w: &Words| !contains(&w.stem, &DERIVED) && contains(&w.stem, &["usbl", "pos", "p", "fix"]);
        let x = (0..self.words.len()).find(|k| is_fix(&self.words[*k]) && self.words[*k].before("x").is_some());
        if let Some((x, y)) = x.and_then(|x| Some((x, self.sibling(x, "x", "y")?))) {
            self.add(Kind::Local, vec![(y, false), (x, false), (depth, false)]);
        }
    }

    /// Three neighbouring columns whose length is one g most of the time are the accelerometers; three
    /// neighbouring ones beside them whose mean is small against their range, the gyros.
    fn unnamed(&mut self) {
        let length = |k: usize, row: usize| norm([0, 1, 2].map(|i| self.table.columns[k + i].values[row]));
        let starts = 0..self.table.columns.len().saturating_sub(2);
        let is_gravity = |k: &usize| {
            let m = median((0..self.table.rows()).map(|row| length(*k, row)));
            (9.6..10.0).contains(&m) || (0.98..1.02).contains(&m)
        };
        let Some(a) = starts.clone().find(is_gravity) else { return };
        let beside = [a.checked_sub(3), Some(a + 3)].into_iter().flatten();
        let gyro = beside.filter(|k| starts.contains(k)).find(|k| {
            (0..3).all(|i| {
                let values = &self.table.columns[k + i].values;
                let (low, high) = (quantile(values.iter().copied(), 0.02), quantile(values.iter().copied(), 0.98));
                low < 0.0 && high > 0.0
            })
        });
        self.add(Kind::SpecificForce, (a..a + 3).map(|k| (k, false)).collect());
        if let Some(g) = gyro {
            self.add(Kind::AngularRate, (g..g + 3).map(|k| (k, false)).collect());
        }
        self.found.iter_mut().for_each(|s| s.why = "by its values".to_owned());
    }
}

/// Finds unit and factor of a signal, by the name or by the values.
fn settle(signal: &mut Signal, table: &Table, rate: f64) {
    if let Some((unit, why)) = unit_by_values(signal, table, rate) {
        signal.why = format!("{}; {unit}: {why}", signal.why);
        signal.unit = unit.to_owned();
    }
    signal.factor = match (signal.kind, signal.unit.as_str()) {
        (Kind::SpecificForce, "counts") => GRAVITY / length(signal, table, 0.5),
        (_, unit) => factor(unit),
    };
}

/// Tells the unit of gyros that no name tells by how the magnetic field turns, or gravity, where they do: hands turn a
/// unit faster than 10 rad/s, and vehicles slower than 10 deg/s.
fn settle_by_turns(found: &mut [Signal], table: &Table, rate: f64) {
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
    let mut slopes = told.filter_map(|(direction, name)| Some((turn::slope(direction, &raw, rate)?, *name)));
    let Some((slope, what)) = slopes.next() else { return };
    let (radians, degrees) = (1.0, 1_f64.to_radians());
    // On a logarithmic scale half-way between the two.
    let unit = if slope > (radians * degrees).sqrt() { "rad/s" } else { "deg/s" };
    if (slope / factor(unit)).ln().abs() < 2_f64.ln() {
        gyros.unit = unit.to_owned();
        gyros.factor = factor(unit);
        let found = gyros.why.split(';').next().unwrap_or_default().to_owned();
        gyros.why = format!("{found}; {unit}: {what} turns by {:.2} of what they say", slope / gyros.factor);
    }
}

/// The length of a vector that a share of the rows stays below, in the unit of its columns.
fn length(signal: &Signal, table: &Table, share: f64) -> f64 {
    quantile((0..table.rows()).map(|row| norm(signal.raw(table, row))), share)
}

/// The unit that the values look like, and why; `None` where the name says it.
fn unit_by_values(s: &Signal, table: &Table, rate: f64) -> Option<(&'static str, String)> {
    let reach = |axis: usize| quantile((0..table.rows()).map(|row| s.raw(table, row)[axis].abs()), 0.99);
    if s.kind == Kind::SpecificForce && s.increment {
        let m = length(s, table, 0.5) * rate;
        return Some(("m/s", format!("increments, median length × {rate:.0} Hz = {m:.2}")));
    }
    if !matches!(s.unit.as_str(), "" | "counts") {
        return None;
    }
    Some(match s.kind {
        Kind::SpecificForce => match length(s, table, 0.5) {
            m if (9.0..10.6).contains(&m) => ("m/s^2", format!("median length {m:.2}")),
            m if (0.9..1.1).contains(&m) => ("g", format!("median length {m:.3}")),
            m => ("counts", format!("median length {m:.1}, taken as one g")),
        },
        Kind::AngularRate if s.unit == "counts" => return None,
        Kind::AngularRate => match length(s, table, 0.99) {
            p if p > 10.0 => ("deg/s", format!("99 % are within {p:.1}: more than 10 rad/s is rare")),
            p => ("rad/s", format!("99 % are within {p:.2}")),
        },
        // The field of the Earth is 22 to 67 uT; iron adds to it.
        Kind::MagneticField => match length(s, table, 0.5) {
            m if (15.0..120.0).contains(&m) => ("uT", format!("median length {m:.1}")),
            _ => return None,
        },
        Kind::Geodetic if reach(1) > core::f64::consts::PI => ("deg", format!("longitudes reach {:.3}", reach(1))),
        Kind::Geodetic => ("rad", format!("longitudes reach {:.4}", reach(1))),
        Kind::Euler if reach(2) > core::f64::consts::TAU => ("deg", format!("headings reach {:.1}", reach(2))),
        Kind::Euler => ("rad", format!("headings reach {:.2}", reach(2))),
        // Nobody lives where the air has less than a third of the pressure at sea level.
        Kind::Pressure => match length(s, table, 0.5) {
            m if (3e4..1.2e5).contains(&m) => ("Pa", format!("median {m:.0}")),
            m if (300.0..1200.0).contains(&m) => ("hPa", format!("median {m:.1}")),
            m if (30.0..120.0).contains(&m) => ("kPa", format!("median {m:.2}")),
            _ => return None,
        },
        Kind::Local | Kind::Depth | Kind::PositionSigma => ("m", "no unit is named".to_owned()),
        Kind::Velocity | Kind::BodyVelocity | Kind::Speed | Kind::VelocitySigma => ("m/s", "no unit is named".to_owned()),
        _ => return None,
    })
}
