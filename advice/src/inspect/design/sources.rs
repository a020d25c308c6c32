//! The tables of sources.

use super::toml::{Text, array, quoted};
use crate::inspect::log::Log;
use crate::inspect::numbers::Vec3;
use crate::inspect::pair::{cross, dot, horizontal};
use crate::inspect::signal::{Kind, Signal, of_unit};
use crate::inspect::words::{Words, contains};
use crate::inspect::{Clock, Form, Inspection, Origin};
use fusion::source::table::utc_text;

/// Above this share, repeated rows are not separate measurements.
const REPEATED: f64 = 0.1;
/// A position of zero means a missing position if more rows than this share have it.
const ZEROS: f64 = 0.01;
/// A clock drift larger than this over the log is corrected \[s\].
const DRIFT: f64 = 0.05;

impl Inspection {
    /// `[source.NAME]` with the channels of these kinds, and an extra line.
    pub(super) fn source(&self, text: &mut Text, name: &str, k: usize, kinds: &[Kind], more: &str) {
        let log = &self.logs[k];
        let Some(clock) = &log.clock else { return };
        text.table(&format!("source.{name}"));
        text.quoted("type", log.table.format.name);
        let path = log.table.path.strip_prefix(self.common()).unwrap_or(&log.table.path);
        text.quoted("path", &path.display().to_string());
        if !["", ","].contains(&log.table.delimiter.as_str()) {
            text.quoted("delimiter", &log.table.delimiter);
        }
        self.text_of(text, log);
        if !log.table.header {
            text.line(
                "header = false",
                "guessed: the first line holds numbers only; columns are called 1, 2, …",
            );
        }
        self.time(text, name, log, clock);
        let signals: Vec<&Signal> = kinds.iter().filter_map(|kind| log.signal(*kind)).collect();
        self.rows(text, k, &signals);
        text.reads(k, signals.iter().flat_map(|s| s.columns.iter().map(|c| c.0)));
        if name == "imu" || name == "attitude_reference" {
            let increments = signals.iter().any(|s| s.increment);
            text.line(&format!("rate = \"{:.3} Hz\"", clock.rate), "the median interval");
            if increments {
                text.line("interval = \"nominal\"", "guessed: the unit samples evenly, its stamps jitter");
            }
        }
        if !more.is_empty() {
            text.line(more, "");
        }
        text.line(&format!("[source.{name}.channels]"), "");
        for signal in signals {
            self.channel(text, name, log, signal);
        }
    }

    /// The text format: comments, and lines that are no rows.
    fn text_of(&self, text: &mut Text, log: &Log) {
        let table = &log.table;
        if let Some(mark) = table.comment {
            text.line(&format!("comment = {}", quoted(mark)), "the file begins with such lines");
        }
        if table.is_commented {
            text.line("header = \"comment\"", "the last comment names the columns");
        }
        if let Some(names) = &table.names {
            text.line(
                &format!("names = {}", array(names)),
                "a name of the file stands for several columns: that of the line below is added",
            );
        }
        if table.skip > 0 {
            text.line(&format!("skip = {}", table.skip), "the lines before the rows that are no rows");
        }
    }

    fn time(&self, text: &mut Text, name: &str, log: &Log, clock: &Clock) {
        let mut parts = Vec::new();
        let name_of = |column: usize| quoted(&log.table.columns[column].name);
        if clock.form == Form::Even {
            parts.push(format!("rate = \"{} Hz\"", clock.rate));
        } else if !log.table.format.has_own_clock {
            parts.push(format!("column = {}", name_of(clock.column)));
            if let Some(calendar) = &log.table.columns[clock.column].calendar {
                parts.extend(calendar.date.map(|date| format!("date = {}", name_of(date))));
                parts.push(format!("calendar = \"{}\"", calendar.scale));
                parts.extend(clock.day.as_ref().map(|day| format!("day = \"{}\"", day.date)));
            } else if clock.form == Form::Counter {
                parts.push(format!("rate = \"{} Hz\"", clock.rate));
            } else if clock.unit != "s" {
                parts.push(format!("unit = \"{}\"", clock.unit));
            }
            if let Form::Sum { second, each } = clock.form {
                parts.push(format!("plus = {{ column = {}, each = \"{each}\" }}", name_of(second)));
            }
            if let Form::Recordings { second, each } = clock.form {
                parts.push(format!("plus = {{ column = {}, each = \"{each} s\" }}", name_of(second)));
            }
            if clock.form != Form::Calendar {
                match clock.origin {
                    Origin::Unknown => {}
                    Origin::Gps => parts.push("counts_from = \"gps\"".to_owned()),
                    Origin::Unix => parts.push("counts_from = \"unix\"".to_owned()),
                }
            }
        }
        if let Some(begin) = self.epoch() {
            parts.push(match clock.origin {
                Origin::Unknown => format!("epoch = {}", epoch(begin, clock.unit)),
                _ => format!("epoch = \"{}\"", utc_text(begin as i64)),
            });
        }
        if clock.shift != 0.0 {
            parts.push(format!("offset = \"{:.2} s\"", clock.shift));
        }
        if let Some(scale) = self.drift().filter(|_| name == "imu") {
            parts.push(format!("scale = {scale:.9}"));
        }
        if clock.ties > 0 {
            parts.push("ties = \"skip\"".to_owned());
        }
        if clock.backwards > 0 {
            parts.push("backwards = \"skip\"".to_owned());
        }
        if parts.is_empty() {
            return;
        }
        let mut why = match clock.form {
            _ if log.table.format.has_own_clock => Vec::new(),
            Form::Count | Form::Recordings { .. } => vec![format!("unit: {}", clock.why)],
            _ if clock.day.is_none() => vec![clock.why.clone()],
            _ => Vec::new(),
        };
        why.extend(clock.why_day());
        if let Form::Recordings { second, .. } = clock.form {
            let number = &log.table.columns[second].name;
            why.push(format!(
                "guessed: the clock begins anew with each `{number}`, so they are put one after the other"
            ));
        }
        if clock.origin == Origin::Unix {
            why.push("counted since 1970, guessed: so it is of the time of the other files".to_owned());
        }
        if clock.shift != 0.0 {
            why.push("offset guessed: there its turns agree with the positions".to_owned());
        }
        if parts.iter().any(|p| p.starts_with("scale")) {
            why.push("scale guessed: the lag against the positions changes over the log".to_owned());
        }
        text.line(&format!("time = {{ {} }}", parts.join(", ")), &why.join("; "));
    }

    /// The second that stamps are counted from, if they would be large otherwise.
    pub(super) fn epoch(&self) -> Option<f64> {
        Some(self.begin().floor()).filter(|begin| *begin > 1e6)
    }

    /// The scale of the unit's clock, if it drifts against the clock of the positions.
    pub(super) fn drift(&self) -> Option<f64> {
        let (first, last) = self.pair?.lags?;
        let (k, _) = self.imu.as_ref()?;
        let between = self.logs[*k].duration() * 2.0 / 3.0;
        ((last - first).abs() > DRIFT).then(|| 1.0 + (last - first) / between)
    }

    /// The rows that are used.
    fn rows(&self, text: &mut Text, k: usize, signals: &[&Signal]) {
        let log = &self.logs[k];
        if log.table.malformed > 0 || signals.iter().any(|s| log.missing(s) > 0.0) {
            text.line("bad_rows = \"skip\"", "some rows are cut off or lack numbers");
        }
        let repeated = signals.iter().map(|s| log.repeats(s).share).reduce(f64::min);
        if let Some(repeated) = repeated.filter(|share| *share > REPEATED && log.repeats_are_copies(signals)) {
            let why = format!("{:.0} % of the rows repeat the one before", 100.0 * repeated);
            text.line("repeats = \"drop\"", &why);
        }
        // The conditions on rows, each with its reason.
        let mut conditions: Vec<(String, String)> = Vec::new();
        if let Some(instances) = &log.instances {
            let (name, first) = (quoted(&log.table.columns[instances.column].name), instances.numbers[0]);
            text.reads(k, [instances.column]);
            let why = format!("{} instruments are in this file; the first one", instances.numbers.len());
            conditions.push((format!("{{ column = {name}, equals = {first} }}"), why));
        }
        let is_place = |s: &Signal| matches!(s.kind, Kind::Geodetic | Kind::Local);
        let position = signals.iter().copied().find(|s| is_place(s));
        // A depth in the columns of a position is valid when the position is.
        let is_within = |s: &&Signal| signals.iter().any(|own| s.columns.iter().any(|c| own.columns.contains(c)));
        let position = position.or_else(|| log.signals.iter().filter(|s| is_place(s)).find(is_within));
        if let Some((column, condition, why)) = position.and_then(|position| validity(log, position)) {
            text.reads(k, [column]);
            conditions.push((format!("{{ {condition} }}"), why));
        }
        let (conditions, why): (Vec<String>, Vec<String>) = conditions.into_iter().unzip();
        match conditions.as_slice() {
            [] => {}
            [only] => text.line(&format!("valid = {only}"), &why[0]),
            all => text.line(&format!("valid = [{}]", all.join(", ")), &why.join("; ")),
        }
    }

    fn channel(&self, text: &mut Text, source: &str, log: &Log, signal: &Signal) {
        let names = signal.names(&log.table);
        let unit = |u: &str| if u.is_empty() { String::new() } else { format!(", unit = \"{u}\"") };
        let columns = format!("columns = {}{}", array(&names), unit(&signal.unit));
        // A filter in the plane has no height to judge.
        let is_judge = matches!(source, "withheld" | "reference");
        let is_in_plane = is_judge && self.driver() == Some(super::Driver::Odometer);
        let is_of_flat = match signal.kind {
            Kind::VelocitySigma => log.has_flat_velocity(),
            Kind::PositionSigma => is_in_plane && log.has(Kind::Geodetic),
            _ => false,
        };
        let body = match signal.kind {
            Kind::SpecificForce | Kind::AngularRate | Kind::MagneticField => {
                let mut body = match (signal.kind, signal.unit.as_str()) {
                    (Kind::SpecificForce, "counts") => {
                        format!("columns = {}, unit = \"m/s^2\", scale = {:.9}", array(&names), signal.factor)
                    }
                    _ => columns,
                };
                body += &self.axes();
                body += if signal.increment {
                    ", increment = true"
                } else if is_recorded(signal, log) || source == "magnetometer" {
                    ""
                } else {
                    ", average = true"
                };
                body
            }
            // The judge has the latency of the sensor that reads other rows of it.
            Kind::Velocity => {
                let late = self.lag().filter(|_| source == "withheld").map_or_else(String::new, latency);
                over_ground(log, signal).unwrap_or(columns) + &late
            }
            Kind::BodyVelocity => columns,
            Kind::PositionSigma | Kind::VelocitySigma => {
                let axes = if is_of_flat { 2 } else { 3 };
                format!("columns = {}{}", array(&names[..axes.min(names.len())]), of_unit(&signal.unit))
            }
            Kind::Speed | Kind::YawRate | Kind::Depth | Kind::Pressure => format!("column = {}{}", quoted(&names[0]), unit(&signal.unit)),
            Kind::Geodetic => {
                let late = self
                    .late_position()
                    .filter(|_| source == "withheld")
                    .map_or_else(String::new, latency);
                let height = names
                    .get(2)
                    .filter(|_| !is_in_plane)
                    .map_or_else(String::new, |height| format!(", height = {}", quoted(height)));
                format!(
                    "latitude = {}, longitude = {}{height}, unit = \"{}\"{late}",
                    quoted(&names[0]),
                    quoted(&names[1]),
                    signal.unit
                )
            }
            Kind::Local => {
                let vertical = if signal.columns.get(2).is_some_and(|c| c.1) { "up" } else { "down" };
                let third = names.get(2).map_or(String::new(), |n| n.trim_start_matches('-').to_owned());
                format!(
                    "north = {}, east = {}, {vertical} = {}{}",
                    quoted(&names[0]),
                    quoted(&names[1]),
                    quoted(&third),
                    unit(if signal.unit == "m" { "" } else { &signal.unit })
                )
            }
            Kind::Quaternion => {
                let world = if !log.has(Kind::Geodetic) {
                    ", navigation_rotation = { axes = [\"y\", \"x\", \"-z\"] }"
                } else {
                    ""
                };
                let body = if log.has(Kind::Geodetic) { String::new() } else { self.axes() };
                format!("quaternion = {}{world}{body}", array(&names))
            }
            Kind::Euler => {
                self.undecided_heading(text, &names);
                self.euler(&names, &signal.unit)
            }
            Kind::Heading => {
                let yaw = self.yaw.filter(|yaw| yaw.is_decided());
                let sign = if yaw.is_none_or(|yaw| yaw.is_clockwise) { "" } else { "-" };
                let name = format!("{sign}{}", names[0]);
                format!("column = {}{}{}", quoted(&name), unit(&signal.unit), self.quarter("\"{} deg\""))
            }
            Kind::Wheels | Kind::GroundSpeed => return,
        };
        let is_flat = signal.columns.len() < 3 || is_in_plane;
        let is_horizontal = signal.kind == Kind::Geodetic && is_flat;
        let name = if is_horizontal {
            "horizontal_position"
        } else if signal.kind == Kind::Velocity && signal.columns.len() < 3 {
            "horizontal_velocity"
        } else if is_of_flat {
            match signal.kind {
                Kind::PositionSigma => "horizontal_position_sigma",
                _ => "horizontal_velocity_sigma",
            }
        } else {
            channel_name(signal.kind)
        };
        let mut why = format!("guessed {}", signal.why);
        if matches!(signal.kind, Kind::SpecificForce | Kind::AngularRate) && !signal.increment {
            why += if is_recorded(signal, log) {
                "; means over the interval, as `fusion record` writes them"
            } else {
                "; `average`: taken as instants, nothing here tells them from means over the interval"
            };
        }
        text.line(&format!("{name} = {{ {body} }}"), &why);
    }

    /// The choices if the course does not determine the convention of the heading.
    fn undecided_heading(&self, text: &mut Text, names: &[String]) {
        let Some(yaw) = self.yaw.filter(|yaw| !yaw.is_decided()) else {
            return;
        };
        text.comment(&format!(
            "not decided: the heading agrees with the course to {:.2} of 1 only. It is read as clockwise from north:",
            yaw.agreement
        ));
        let against = [names[0].clone(), format!("-{}", names[1]), format!("-{}", names[2])];
        text.comment(&format!(
            "`rpy = {}`; if it counts anti-clockwise from east: `rpy = {}` with `offset = [0, 0, \"90 deg\"]`",
            array(names),
            array(&against)
        ));
    }

    /// Roll, pitch, yaw: for an aeroplane, or for axes forward, left, up if the heading counts anti-clockwise.
    fn euler(&self, names: &[String], unit: &str) -> String {
        let Some(yaw) = self.yaw.filter(|yaw| yaw.is_decided()) else {
            return format!("rpy = {}, unit = \"{unit}\"", array(names));
        };
        let offset = self.quarter("[0, 0, \"{} deg\"]");
        let against = |name: &String| if yaw.is_clockwise { name.clone() } else { format!("-{name}") };
        let all = [names[0].clone(), against(&names[1]), against(&names[2])];
        format!("rpy = {}, unit = \"{unit}\"{offset}", array(&all))
    }

    /// `offset` of a recorded heading, in this form, rounded to quarter turns: the rest is the mounting of the
    /// instrument.
    fn quarter(&self, form: &str) -> String {
        let yaw = self.yaw.filter(|yaw| yaw.is_decided());
        let quarter = yaw.map_or(0.0, |yaw| 90.0 * (yaw.offset.to_degrees() / 90.0).round());
        if quarter == 0.0 {
            String::new()
        } else {
            format!(", offset = {}", form.replace("{}", &quarter.to_string()))
        }
    }

    /// `rotation` from the sensor's axes to forward, right, down; empty if they are the same.
    fn axes(&self) -> String {
        let Some(axes) = self.body_axes() else { return String::new() };
        let named = |v: Vec3| {
            let k = (0..3).find(|k| v[*k].abs() > 0.5).unwrap_or(0);
            crate::inspect::page::axis((k, v[k] < 0.0))
        };
        let all = axes.map(named);
        if all == ["x", "y", "z"] {
            return String::new();
        }
        format!(", rotation = {{ axes = {} }}", array(&all))
    }

    /// A vector in the sensor's axes, transformed to body axes.
    pub(super) fn in_body(&self, v: Vec3) -> Vec3 {
        self.body_axes().map_or(v, |axes| axes.map(|axis| dot(axis, v)))
    }

    /// Forward, right and down in the sensor's axes.
    fn body_axes(&self) -> Option<[Vec3; 3]> {
        let (_, imu) = self.imu.as_ref()?;
        let (first, second) = horizontal(imu.up);
        let down = cross(first, second);
        let forward = match self.quarters() {
            0 => first,
            1 => second,
            2 => first.map(|x| -x),
            _ => second.map(|x| -x),
        };
        Some([forward, cross(down, forward), down])
    }

    /// The number of quarter turns from the first horizontal axis to the vehicle's forward axis, to the right.
    pub(super) fn quarters(&self) -> i32 {
        let forward = self.pair.and_then(|p| p.ahead());
        let angle = forward.map_or(0.0, |(angle, _)| angle);
        ((angle / core::f64::consts::FRAC_PI_2).round() as i32).rem_euclid(4)
    }
}

/// Returns true if a log of `fusion record` has these columns, by their names. Its samples are means over the interval
/// that ends at the stamp.
fn is_recorded(signal: &Signal, log: &Log) -> bool {
    let unit = if signal.kind == Kind::SpecificForce { "m/s^2" } else { "rad/s" };
    let written = ["x", "y", "z"].map(|axis| format!("{}_{axis} [{unit}]", channel_name(signal.kind)));
    signal.names(&log.table) == written
}

/// The name of a channel.
const fn channel_name(kind: Kind) -> &'static str {
    match kind {
        Kind::SpecificForce => "specific_force",
        Kind::AngularRate => "angular_rate",
        Kind::MagneticField => "magnetic_field",
        Kind::Geodetic | Kind::Local => "position",
        Kind::Velocity => "velocity",
        Kind::BodyVelocity => "body_velocity",
        Kind::Quaternion | Kind::Euler => "attitude",
        Kind::Speed | Kind::GroundSpeed => "speed",
        Kind::Heading => "heading",
        Kind::YawRate => "yaw_rate",
        Kind::Depth => "depth",
        Kind::PositionSigma => "position_sigma",
        Kind::VelocitySigma => "velocity_sigma",
        Kind::Wheels => "wheels",
        Kind::Pressure => "pressure",
    }
}

/// A velocity as speed and course; `None` for a velocity along axes.
fn over_ground(log: &Log, signal: &Signal) -> Option<String> {
    let course_unit = signal.course?;
    let name = |k: usize| quoted(&log.table.columns[signal.columns[k].0].name);
    let vertical = signal.columns.get(2).map_or_else(String::new, |(_, is_up)| {
        let key = if *is_up { "up" } else { "down" };
        format!(", {key} = {{ column = {}, unit = \"{}\" }}", name(2), signal.unit)
    });
    let missing = |k: usize| {
        let of = |k: usize| {
            log.table.columns[signal.columns[k].0]
                .values
                .iter()
                .filter(|v| !v.is_finite())
                .count()
        };
        of(k) > of(0)
    };
    // A vehicle at rest has no course.
    let valid = if missing(1) {
        format!(", valid = {{ column = {}, not_equals = \"\" }}", name(1))
    } else {
        String::new()
    };
    Some(format!(
        "speed = {{ column = {}, unit = \"{}\" }}, course = {{ column = {}, unit = \"{course_unit}\" }}{vertical}{valid}",
        name(0),
        signal.unit,
        name(1)
    ))
}

/// The `latency` of a late channel \[s\].
fn latency(lag: f64) -> String {
    if lag > 0.0 {
        format!(", latency = \"{lag:.2} s\"")
    } else {
        String::new()
    }
}

/// A whole second in stamps of this unit.
fn epoch(seconds: f64, unit: &str) -> String {
    let zeros = match unit {
        "ms" => 3,
        "us" => 6,
        "ns" => 9,
        _ => 0,
    };
    format!("{seconds:.0}{}", "0".repeat(zeros))
}

/// The column that shows whether a position is valid, the condition, and the reason.
fn validity(log: &Log, position: &Signal) -> Option<(usize, String, String)> {
    let words: Vec<Words> = log.table.columns.iter().map(|c| Words::of(c.called())).collect();
    let first = words[position.columns[0].0].stem.split('_').next().unwrap_or_default().to_owned();
    let flag = words
        .iter()
        .position(|w| contains(&w.stem, &["valid"]) && w.stem.starts_with(&first));
    if let Some(k) = flag {
        let name = quoted(&log.table.columns[k].name);
        return Some((k, format!("column = {name}, equals = 1"), "guessed by its name".to_owned()));
    }
    let quality = words
        .iter()
        .position(|w| w.ends_with(&["q", "quality", "fix", "fixtype"]) && w.stem.len() < 10);
    if let Some(k) = quality {
        let values = || log.table.columns[k].values.iter().copied().filter(|v| v.is_finite());
        // In a column with two values, zero means no fix, however often it appears.
        let is_flag = values().all(|v| v == 0.0 || v == 1.0) && values().any(|v| v == 1.0);
        let usual = if is_flag { 1.0 } else { log.typical(k) };
        let others = log.table.columns[k].values.iter().filter(|v| **v != usual).count();
        if others > 0 && usual.fract() == 0.0 {
            let name = quoted(&log.table.columns[k].name);
            return Some((
                k,
                format!("column = {name}, equals = {usual}"),
                if is_flag {
                    format!("guessed: of 0 and 1, 0 means no fix; {others} rows have it")
                } else {
                    format!("guessed: the usual one; {others} rows have another")
                },
            ));
        }
    }
    if log.zeros(position) < ZEROS {
        return None;
    }
    let share = format!(
        "guessed: {:.0} % of the rows have a position of zero: none",
        100.0 * log.zeros(position)
    );
    // A height may be zero or negative; the first column of a place is zero only by chance.
    let k = position.columns.first()?.0;
    let name = quoted(&log.table.columns[k].name);
    Some((k, format!("column = {name}, not_equals = 0"), share))
}
