//! Finds quantities by the names of columns, and an inertial unit by its values.

use super::numbers::{median, norm, quantile};
use super::signal::{Kind, Signal};
use super::size::{is_beyond, is_without_gravity, settle, settle_by_turns};
use super::types;
use super::words::{QUATERNION, Words, contains, is_called, is_height, is_phrase};
use core::ops::Range;
use fusion::source::table::{LogColumn, LogTable};

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

pub(super) struct Finder<'a> {
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
    let found = finder.found.iter().filter(|s| s.kind.sigmas().is_some());
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

impl<'a> Finder<'a> {
    pub(super) fn of(table: &'a LogTable) -> Self {
        Self {
            table,
            words: table.columns.iter().map(|c| Words::of(c.called())).collect(),
            found: Vec::new(),
        }
    }

    /// All quantities of the table.
    pub(super) fn all(mut self) -> Vec<Signal> {
        let fields = self.table.topic.as_ref().and_then(|topic| types::fields(&topic.message_type));
        // A logger may use the name of a type and its own names of fields.
        if let Some(fields) = fields.filter(|fields| self.has_one_of(fields)) {
            self.typed(fields);
            return self.found;
        }
        if self.table.header {
            self.vectors();
            self.sigmas();
            self.over_ground();
            self.scalars();
            self.local_with_depth();
        }
        self.unnamed();
        self.found
    }

    /// Whether the table has a field of a message type.
    fn has_one_of(&self, fields: types::Fields) -> bool {
        let names = fields
            .iter()
            .flat_map(|(_, names, _)| *names)
            .map(|name| name.trim_start_matches('-'));
        names
            .into_iter()
            .any(|name| self.table.columns.iter().any(|column| column.name == name))
    }

    /// The quantities whose fields have values other than zero.
    fn typed(&mut self, fields: types::Fields) {
        for (kind, names, unit) in fields {
            let columns = names.iter().filter_map(|name| {
                let (plain, is_against) = name.strip_prefix('-').map_or((*name, false), |plain| (plain, true));
                let column = self.table.columns.iter().position(|column| column.name == plain)?;
                Some((column, is_against))
            });
            let mut columns: Vec<(usize, bool)> = columns.collect();
            let is_zero = |(k, _): &(usize, bool)| self.table.columns[*k].values.iter().all(|v| *v == 0.0);
            let has = |kind: Kind| self.found.iter().any(|s| s.kind == kind);
            if *kind == Kind::Speed && has(Kind::BodyVelocity) {
                continue;
            }
            // In a plane, the variance along up is zero, so that across is used for it.
            if let (Kind::PositionSigma, [_, across, up]) = (*kind, &mut columns[..])
                && is_zero(up)
            {
                *up = *across;
            }
            if kind
                .sigmas()
                .is_some_and(|usual| !columns.iter().all(|(k, _)| self.is_variance(*k, &usual)))
            {
                continue;
            }
            // Two axes that are always zero are not measured.
            if columns.len() != names.len() || columns.iter().filter(|column| is_zero(column)).count() > columns.len() / 2 {
                continue;
            }
            if let Some(found) = self.add(*kind, columns) {
                (found.unit, found.why) = ((*unit).to_owned(), "by the type of the message".to_owned());
            }
        }
    }

    /// Whether a column has a variance in each row that has a number, and a usual 1σ.
    fn is_variance(&self, column: usize, usual: &Range<f64>) -> bool {
        let values = || self.table.columns[column].values.iter().copied().filter(|v| v.is_finite());
        values().all(|v| v > 0.0) && usual.contains(&fusion_core::math::sqrt(median(values())))
    }

    /// Adds a quantity in the unit that its first column names; `None` if there is one of this kind.
    fn add(&mut self, kind: Kind, columns: Vec<(usize, bool)>) -> Option<&mut Signal> {
        if self.found.iter().any(|s| s.kind == kind) {
            return None;
        }
        let unit = columns.first().and_then(|(k, _)| self.words[*k].unit);
        self.found.push(Signal {
            kind,
            why: "by name".to_owned(),
            unit: unit.unwrap_or_default().to_owned(),
            factor: 1.0,
            increment: false,
            course: None,
            of_height: "m",
            is_body: false,
            columns,
        });
        self.found.last_mut()
    }

    /// Returns true if no quantity has this column.
    fn is_free(&self, column: usize) -> bool {
        self.found.iter().all(|s| s.columns.iter().all(|c| c.0 != column))
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
            // The elements of a matrix are no vector.
            if contains(&stem, &DERIVED) || contains(&stem, &["covariance"]) {
                continue;
            }
            if let (Some(prefix), Some(y), Some(z)) = (self.words[k].before("x"), self.sibling(k, "x", "y"), self.sibling(k, "x", "z")) {
                let prefix = prefix.to_owned();
                self.axes_xyz(&prefix, unit, &[(k, false), (y, false), (z, false)]);
            }
            if let Some((prefix, columns)) = self.along(k, &BODY).filter(|(_, columns)| columns.len() == 3)
                && let Some(found) = self.axes_xyz(&prefix, unit, &columns).filter(|s| s.columns == columns)
            {
                found.is_body = true;
                found.why = "by name: forward, right, down".to_owned();
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
    fn axes_xyz(&mut self, prefix: &str, unit: Option<&'static str>, columns: &[(usize, bool)]) -> Option<&mut Signal> {
        let is_quaternion = is_called(prefix, &QUATERNION) || (prefix.is_empty() && self.is_file_called(&QUATERNION));
        if let Some(w) = self.sibling(columns[0].0, "x", "w").filter(|_| is_quaternion) {
            return self.add(Kind::Quaternion, [&[(w, false)], columns].concat());
        }
        let (kind, unit, increment) = body_vector(prefix, unit)?;
        let (columns, why) = match (kind, columns) {
            // Metres x, y, z of a room or a map: taken as east, north, up.
            (Kind::Local, [x, y, z]) => (vec![*y, *x, (z.0, !z.1)], "by name: x, y, z as east, north, up"),
            (Kind::BodyVelocity, _) => (columns.to_vec(), "by name: x, y, z as forward, right, down"),
            _ => (columns.to_vec(), "by name"),
        };
        let found = self.add(kind, columns)?;
        (found.unit, found.increment, found.why) = (unit.to_owned(), increment, why.to_owned());
        Some(found)
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
        let kind = match (prefix, unit) {
            ("", Some("m/s" | "cm/s" | "km/h")) => Kind::Velocity,
            _ if is_velocity => Kind::Velocity,
            ("" | "p", None | Some("m" | "cm" | "mm")) => Kind::Local,
            (_, None | Some("m" | "cm" | "mm")) if is_called(prefix, &["pos", "position"]) => Kind::Local,
            _ => return,
        };
        self.add(kind, columns);
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
                Some(Kind::VelocitySigma) => ["m/s", "cm/s", "mm/s", "km/h"],
                _ => ["m", "cm", "mm", "km"],
            };
            if let Some(kind) = kind.filter(|_| unit.is_some_and(|unit| expected.contains(&unit)) && !contains(stem, &DERIVED)) {
                self.add_sigma(kind, vec![k; 3]);
            }
        }
    }

    fn add_sigma(&mut self, kind: Kind, columns: Vec<usize>) {
        let is_variance = contains(&self.words[columns[0]].stem, &VARIANCE);
        let found = self.add(kind, columns.into_iter().map(|k| (k, false)).collect());
        if let Some(found) = found.filter(|s| is_variance && s.unit.is_empty()) {
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
        const SPEED: [&str; 5] = ["m/s", "cm/s", "mm/s", "km/h", "kn"];
        let find = |names: &[&str], units: &[&str], is_right: &dyn Fn(usize) -> bool| {
            let is_called =
                |w: &Words| w.ends_with(names) && !contains(&w.stem, &DERIVED) && w.unit.is_none_or(|unit| units.contains(&unit));
            (0..self.words.len()).find(|k| is_called(&self.words[*k]) && is_right(*k))
        };
        let own = find(&OWN, &SPEED, &|_| true);
        let Some(speed) = own.or_else(|| find(&["speed", "spd"], &SPEED, &|k| self.is_of_fixes(k))) else {
            return;
        };
        let has_velocity = self.found.iter().any(|s| s.kind == Kind::Velocity);
        let Some(course) = find(&COURSE, &["deg", "cdeg", "rad"], &|_| true).filter(|_| !has_velocity) else {
            self.add(Kind::GroundSpeed, vec![(speed, false)]);
            return;
        };
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
        let vertical = vertical.filter(|(k, _)| self.is_free(*k));
        let reach = quantile(self.table.columns[course].values.iter().map(|v| v.abs()), 0.99);
        let by_values = if reach > core::f64::consts::TAU { "deg" } else { "rad" };
        let unit = self.words[course].unit.unwrap_or(by_values);
        let columns = [(speed, false), (course, false)].into_iter().chain(vertical).collect();
        if let Some(found) = self.add(Kind::Velocity, columns) {
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
        let is_length = |k: &usize| matches!(self.words[*k].unit, None | Some("m" | "cm" | "mm"));
        let all = (0..self.words.len()).filter(|k| is_length(k) && is_height(&self.words[*k].stem));
        all.min_by_key(|k| ["msl", "sea"].iter().any(|datum| self.words[*k].stem.contains(datum)))
    }

    fn scalars(&mut self) {
        if let (Some(lat), Some(lon)) = (self.one(&["lat", "latitude"]), self.one(&["lon", "lng", "long", "longitude"])) {
            let height = self.one(&["h", "alt", "height", "altitude"]).or_else(|| self.height());
            let columns = [Some(lat), Some(lon), height].into_iter().flatten();
            let of_height = height.and_then(|k| self.words[k].unit).unwrap_or("m");
            if let Some(found) = self.add(Kind::Geodetic, columns.map(|k| (k, false)).collect()) {
                found.of_height = of_height;
            }
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
            "headingt",
            "headt",
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
            if let Some(k) = self.one(names).filter(|k| self.is_free(*k)) {
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
        if let Some((x, y)) = x.and_then(|x| Some((x, self.sibling(x, "x", "y")?)))
            && let Some(found) = self.add(Kind::Local, vec![(y, false), (x, false), (depth, false)])
        {
            found.why = "by name: x, y as east, north".to_owned();
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
        let values = |k: usize| self.table.columns[k].values.iter().copied();
        let is_free = |k: usize| self.is_free(k) && values(k).zip(values(k).skip(1)).any(|(a, b)| a < b);
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
        for (kind, first) in [(Kind::SpecificForce, force), (Kind::AngularRate, gyro)] {
            let columns = first.map(|first| (first..first + 3).map(|k| (k, false)).collect());
            if let Some(found) = columns.and_then(|columns| self.add(kind, columns)) {
                found.why = "by its values".to_owned();
            }
        }
    }
}

/// The quantity, the unit and whether it is an increment, of a vector along the axes of a body, from the words before
/// its axes and from its unit.
fn body_vector(prefix: &str, unit: Option<&'static str>) -> Option<(Kind, &'static str, bool)> {
    const FIELD: [&str; 4] = ["m", "mag", "magnetometer", "magnetic"];
    let is = |words: &[&str]| is_called(prefix, words);
    let turned = is(&TURNED) || is_phrase(prefix, &DELTA_ANGLE);
    let gained = is(&GAINED) || is_phrase(prefix, &DELTA_VELOCITY);
    let gyros = is(&GYROS) || is_phrase(prefix, &ANGULAR_RATE);
    let named = unit.unwrap_or_default();
    Some(match unit {
        // G may mean gauss.
        Some("g") if is(&FIELD) => (Kind::MagneticField, "gauss", false),
        Some("mg") if is(&FIELD) => (Kind::MagneticField, "mgauss", false),
        None if turned => (Kind::AngularRate, "rad", true),
        None if gained => (Kind::SpecificForce, "", true),
        Some("m/s^2" | "g" | "mg") => (Kind::SpecificForce, named, false),
        Some("uT" | "nT" | "T" | "gauss" | "mgauss") => (Kind::MagneticField, named, false),
        Some("m/s") if gained => (Kind::SpecificForce, named, true),
        Some("m/s") if is(&["v", "vel", "velocity", "body_velocity"]) => (Kind::BodyVelocity, named, false),
        Some("rad" | "deg") if turned => (Kind::AngularRate, named, true),
        // `gyro_rad` of PX4 is a rate.
        Some("rad") if gyros => (Kind::AngularRate, "rad/s", false),
        Some("deg") if gyros => (Kind::AngularRate, "deg/s", false),
        Some("rad/s" | "mrad/s" | "deg/s") => (Kind::AngularRate, named, false),
        Some("m") if prefix.is_empty() || is(&["p", "pos", "position"]) => (Kind::Local, named, false),
        Some("counts") | None if is(&ACCELEROMETERS) => (Kind::SpecificForce, named, false),
        Some("counts") | None if gyros => (Kind::AngularRate, named, false),
        None if is(&FIELD) => (Kind::MagneticField, named, false),
        _ => return None,
    })
}

/// The quantities of a table with this row rate.
pub(super) fn signals(table: &LogTable, rate: f64) -> Vec<Signal> {
    let mut found = Finder::of(table).all();
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
