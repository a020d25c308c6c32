//! The tables of sources.

use super::draft::{Draft, list, number};
use crate::inspect::log::Log;
use crate::inspect::numbers::Vec3;
use crate::inspect::pair::{cross, dot, horizontal};
use crate::inspect::signal::{Kind, Signal};
use crate::inspect::words::{Words, contains};
use crate::inspect::{Clock, Form, Inspection, Origin};
use fusion::source::table::utc_text;
use fusion_core::math;
use toml_edit::{InlineTable, Value};

/// Above this share, repeated rows are not separate measurements.
const REPEATED: f64 = 0.1;
/// A position of zero means a missing position if more rows than this share have it.
const ZEROS: f64 = 0.01;
/// A clock drift larger than this over the log is corrected \[s\].
const DRIFT: f64 = 0.05;

impl Inspection {
    /// `[source.NAME]` with the channels of these kinds. `keep` is a key and its number of rows.
    pub(super) fn source(&self, draft: &mut Draft, name: &str, k: usize, kinds: &[Kind], keep: Option<(&str, usize)>) {
        let log = &self.logs[k];
        let Some(clock) = &log.clock else { return };
        draft.table(&format!("source.{name}"));
        draft.set("type", log.table.format.name);
        let path = log.table.path.strip_prefix(self.common()).unwrap_or(&log.table.path);
        draft.set("path", path.display().to_string());
        if let Some(topic) = &log.table.topic {
            draft.guess("topic", topic.name.clone(), &format!("messages of type {}", topic.message_type));
        }
        text_of(draft, log);
        self.time(draft, name, log, clock);
        let signals: Vec<&Signal> = kinds.iter().filter_map(|kind| log.signal(*kind)).collect();
        rows(draft, k, log, &signals);
        draft.reads(k, signals.iter().flat_map(|s| s.columns.iter().map(|c| c.0)));
        if name == "imu" || name == "attitude_reference" {
            draft.guess("rate", format!("{:.3} Hz", clock.rate), "the median interval");
            if signals.iter().any(|s| s.increment) {
                draft.guess("interval", "nominal", "guessed: the unit samples evenly, its stamps jitter");
            }
        }
        if let Some((key, every)) = keep {
            draft.set(key, every as i64);
        }
        draft.channels(name);
        for signal in signals {
            self.channel(draft, name, log, signal);
        }
    }

    fn time(&self, draft: &mut Draft, name: &str, log: &Log, clock: &Clock) {
        let name_of = |column: usize| log.table.columns[column].name.as_str();
        let has_own = log.table.format.clock.is_some();
        if has_own && clock.column != 0 {
            draft.set("time.column", name_of(clock.column));
        }
        if clock.form == Form::Even {
            draft.set("time.rate", format!("{} Hz", clock.rate));
        } else if !has_own {
            draft.set("time.column", name_of(clock.column));
            if let Some(calendar) = &log.table.columns[clock.column].calendar {
                if let Some(date) = calendar.date {
                    draft.set("time.date", name_of(date));
                }
                draft.set("time.calendar", calendar.scale.to_string());
                if let Some(day) = &clock.day {
                    draft.set("time.day", day.date.to_string());
                }
            } else if clock.form == Form::Counter {
                draft.set("time.rate", format!("{} Hz", clock.rate));
            } else if clock.unit != "s" {
                draft.set("time.unit", clock.unit);
            }
            let plus = match clock.form {
                Form::Sum { second, each } => Some((second, each.to_string())),
                Form::Recordings { second, each } => Some((second, format!("{each} s"))),
                _ => None,
            };
            if let Some((second, each)) = plus {
                draft.set("time.plus.column", name_of(second));
                draft.set("time.plus.each", each);
            }
            if let (false, Some(origin)) = (clock.form == Form::Calendar, clock.origin.name()) {
                draft.set("time.counts_from", origin);
            }
        }
        if let Some(begin) = self.epoch() {
            match clock.origin {
                Origin::Unknown => draft.set("time.epoch", number(&epoch(begin, clock.unit))),
                _ => draft.set("time.epoch", utc_text(begin as i64)),
            }
        }
        let drift = self.drift().filter(|_| name == "imu");
        if clock.shift != 0.0 {
            draft.set("time.offset", format!("{:.2} s", clock.shift));
        }
        if let Some(scale) = drift {
            draft.set("time.scale", number(&format!("{scale:.9}")));
        }
        if clock.ties > 0 {
            draft.set("time.ties", "skip");
        }
        if clock.backwards > 0 {
            draft.set("time.backwards", "skip");
        }
        draft.reason("time", &why_time(log, clock, drift.is_some()));
    }

    /// The second that stamps are counted from, if they would be large otherwise.
    pub(super) fn epoch(&self) -> Option<f64> {
        Some(math::floor(self.begin())).filter(|begin| *begin > 1e6)
    }

    /// The scale of the unit's clock, if it drifts against the clock of the positions.
    pub(super) fn drift(&self) -> Option<f64> {
        let (first, last) = self.pair?.lags?;
        let (k, _) = self.imu.as_ref()?;
        let between = self.logs[*k].duration() * 2.0 / 3.0;
        ((last - first).abs() > DRIFT).then(|| 1.0 + (last - first) / between)
    }

    fn channel(&self, draft: &mut Draft, source: &str, log: &Log, signal: &Signal) {
        // A filter in the plane has no height to judge.
        let is_judge = matches!(source, "withheld" | "reference");
        let is_in_plane = is_judge && self.driver() == Some(super::Driver::Odometer);
        let is_of_flat = match signal.kind {
            Kind::VelocitySigma => log.has_flat_velocity(),
            Kind::PositionSigma => is_in_plane && log.has(Kind::Geodetic),
            _ => false,
        };
        if signal.kind == Kind::Wheels {
            return self.side_channels(draft, log, signal);
        }
        if signal.kind == Kind::Euler {
            self.undecided_heading(draft, &signal.names(&log.table));
        }
        let is_flat = signal.columns.len() < 3;
        let is_horizontal = match signal.kind {
            Kind::Geodetic => is_flat || is_in_plane,
            Kind::Velocity => is_flat,
            _ => is_of_flat,
        };
        let name = if is_horizontal {
            format!("horizontal_{}", signal.kind.channel())
        } else {
            signal.kind.channel().to_owned()
        };
        let Some(body) = self.body(source, log, signal, is_horizontal) else {
            return;
        };
        for (key, value) in body {
            draft.set(&format!("{name}.{key}"), value);
        }
        let why = if !matches!(signal.kind, Kind::SpecificForce | Kind::AngularRate) || signal.increment {
            ""
        } else if is_recorded(signal, log) {
            "; means over the interval, as `fusion record` writes them"
        } else {
            "; `average`: taken as instants, nothing here tells them from means over the interval"
        };
        draft.reason(&name, &format!("guessed {}{why}", signal.why));
    }

    /// The entries of a channel; `None` if no sensor reads such a signal.
    fn body(&self, source: &str, log: &Log, signal: &Signal, is_horizontal: bool) -> Option<Vec<(&'static str, Value)>> {
        let names = signal.names(&log.table);
        let unit = (!signal.unit.is_empty()).then(|| ("unit", Value::from(signal.unit.as_str())));
        // The judge has the latency of the sensor that reads other rows of it.
        let late = |lag: Option<f64>| latency(lag.filter(|_| source == "withheld"));
        let columns = |names: &[String]| ("columns", list(names.iter().cloned()));
        let mut body = match signal.kind {
            Kind::SpecificForce | Kind::AngularRate | Kind::MagneticField => self.vector(source, log, signal),
            Kind::Velocity => over_ground(log, signal).unwrap_or_else(|| [columns(&names)].into_iter().chain(unit).collect()),
            Kind::BodyVelocity => [columns(&names)].into_iter().chain(unit).collect(),
            Kind::PositionSigma
            | Kind::VelocitySigma
            | Kind::BodyVelocitySigma
            | Kind::SpeedSigma
            | Kind::YawRateSigma
            | Kind::AttitudeSigma => {
                let axes = if is_horizontal { 2 } else { 3 };
                let variance = signal.is_variance().then(|| ("variance", true.into()));
                [columns(&names[..axes.min(names.len())])]
                    .into_iter()
                    .chain(unit)
                    .chain(variance)
                    .collect()
            }
            Kind::Speed | Kind::YawRate | Kind::Depth | Kind::Pressure => {
                [("column", names[0].as_str().into())].into_iter().chain(unit).collect()
            }
            Kind::Geodetic => {
                let mut body = vec![("latitude", names[0].as_str().into()), ("longitude", names[1].as_str().into())];
                body.extend(
                    names
                        .get(2)
                        .filter(|_| !is_horizontal)
                        .map(|height| ("height", height.as_str().into())),
                );
                body.push(("unit", signal.unit.as_str().into()));
                if signal.of_height != "m" && names.len() > 2 && !is_horizontal {
                    body.push(("height_unit", signal.of_height.into()));
                }
                body
            }
            Kind::Local => {
                let vertical = if signal.columns.get(2).is_some_and(|c| c.1) { "up" } else { "down" };
                let third = names.get(2).map_or("", |n| n.trim_start_matches('-'));
                let mut body = vec![
                    ("north", names[0].as_str().into()),
                    ("east", names[1].as_str().into()),
                    (vertical, third.into()),
                ];
                body.extend(unit.filter(|_| signal.unit != "m"));
                body
            }
            Kind::Quaternion => {
                let mut body = vec![("quaternion", list(names))];
                if !log.has(Kind::Geodetic) {
                    let world = [("axes", list(["y", "x", "-z"]))];
                    body.push(("navigation_rotation", world.into_iter().collect::<InlineTable>().into()));
                    body.extend(self.axes());
                }
                body
            }
            Kind::Euler => self.euler(&names, &signal.unit),
            Kind::Heading => {
                let yaw = self.yaw.filter(|yaw| yaw.is_decided());
                let sign = if yaw.is_none_or(|yaw| yaw.is_clockwise) { "" } else { "-" };
                let mut body = vec![("column", format!("{sign}{}", names[0]).into())];
                body.extend(unit);
                body.extend(self.quarter().map(|quarter| ("offset", quarter.into())));
                body
            }
            Kind::Wheels | Kind::GroundSpeed => return None,
        };
        body.extend(match signal.kind {
            Kind::Velocity => late(self.lag()),
            Kind::Geodetic => late(self.late_position()),
            _ => None,
        });
        Some(body)
    }

    /// The entries of a vector along the axes of its unit.
    fn vector(&self, source: &str, log: &Log, signal: &Signal) -> Vec<(&'static str, Value)> {
        let mut body = vec![("columns", list(signal.names(&log.table)))];
        if signal.kind == Kind::SpecificForce && signal.unit == "counts" {
            body.push(("unit", "m/s^2".into()));
            body.push(("scale", number(&format!("{:.9}", signal.factor))));
        } else if !signal.unit.is_empty() {
            body.push(("unit", signal.unit.as_str().into()));
        }
        body.extend(self.axes());
        if signal.increment {
            body.push(("increment", true.into()));
        } else if !is_recorded(signal, log) && source != "magnetometer" {
            body.push(("average", true.into()));
        }
        body
    }

    /// The choices if the course does not determine the convention of the heading.
    fn undecided_heading(&self, draft: &mut Draft, names: &[String]) {
        let Some(yaw) = self.yaw.filter(|yaw| !yaw.is_decided()) else {
            return;
        };
        draft.note(&format!(
            "not decided: the heading agrees with the course to {:.2} of 1 only. It is read as clockwise from north:",
            yaw.agreement
        ));
        let against = [names[0].clone(), format!("-{}", names[1]), format!("-{}", names[2])];
        draft.note(&format!(
            "`rpy = {}`; if it counts anti-clockwise from east: `rpy = {}` with `offset = [0, 0, \"90 deg\"]`",
            list(names.iter().cloned()),
            list(against)
        ));
    }

    /// Roll, pitch, yaw: for an aeroplane, or for axes forward, left, up if the heading counts anti-clockwise.
    fn euler(&self, names: &[String], unit: &str) -> Vec<(&'static str, Value)> {
        let is_against = self.yaw.is_some_and(|yaw| yaw.is_decided() && !yaw.is_clockwise);
        let signed = |(k, name): (usize, &String)| if is_against && k > 0 { format!("-{name}") } else { name.clone() };
        let rpy = list(names.iter().take(3).enumerate().map(signed));
        let offset = self
            .quarter()
            .map(|quarter| ("offset", list([Value::from(0), 0.into(), quarter.into()])));
        [("rpy", rpy), ("unit", unit.into())].into_iter().chain(offset).collect()
    }

    /// The `offset` of a recorded heading, rounded to quarter turns: the rest is the mounting of the instrument.
    fn quarter(&self) -> Option<String> {
        let yaw = self.yaw.filter(|yaw| yaw.is_decided())?;
        let quarter = 90.0 * math::round(yaw.offset.to_degrees() / 90.0);
        (quarter != 0.0).then(|| format!("{quarter} deg"))
    }

    /// `rotation` from the sensor's axes to forward, right, down; `None` if they are the same.
    fn axes(&self) -> Option<(&'static str, Value)> {
        let named = |v: Vec3| {
            let k = (0..3).find(|k| v[*k].abs() > 0.5).unwrap_or(0);
            crate::inspect::page::axis((k, v[k] < 0.0))
        };
        let all = self.body_axes()?.map(named);
        let rotation = [("axes", list(all.clone()))].into_iter().collect::<InlineTable>();
        (all != ["x", "y", "z"]).then(|| ("rotation", rotation.into()))
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
        let by_track = self.pair.and_then(|p| p.ahead()).map(|(angle, _)| angle);
        // Names that say forward come before a velocity log, which may be turned itself.
        let by_log = || self.turned.filter(|_| !self.is_named_unit()).map(|turned| turned.angle);
        let angle = by_track.or_else(by_log).unwrap_or(0.0);
        (math::round(angle / core::f64::consts::FRAC_PI_2) as i32).rem_euclid(4)
    }
}

/// The text format: comments, and lines that are no rows.
fn text_of(draft: &mut Draft, log: &Log) {
    let table = &log.table;
    if !["", ","].contains(&table.delimiter.as_str()) {
        draft.set("delimiter", table.delimiter.as_str());
    }
    if let Some(mark) = table.comment {
        draft.guess("comment", mark, "the file begins with such lines");
    }
    if table.is_commented {
        draft.guess("header", "comment", "the last comment names the columns");
    }
    if let Some(names) = &table.names {
        let why = "several columns have the same name: the name in the line below is added";
        draft.guess("names", list(names.iter().cloned()), why);
    }
    if table.skip > 0 {
        draft.guess("skip", table.skip as i64, "the lines before the rows that are no rows");
    }
    if !table.header {
        let why = "guessed: the first line holds numbers only; columns are called 1, 2, …";
        draft.guess("header", false, why);
    }
}

/// The reasons for the declaration of a clock.
fn why_time(log: &Log, clock: &Clock, is_scaled: bool) -> String {
    let mut why = match clock.form {
        _ if log.table.format.clock.is_some() => (clock.column != 0).then(|| clock.why.clone()).into_iter().collect(),
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
    if clock.origin == Origin::Unix && log.table.format.clock.is_none() {
        why.push("counted since 1970, guessed: so it is of the time of the other files".to_owned());
    }
    if clock.shift != 0.0 {
        why.push("offset guessed: there its turns agree with the positions".to_owned());
    }
    if is_scaled {
        why.push("scale guessed: the lag against the positions changes over the log".to_owned());
    }
    why.join("; ")
}

/// The rows that are used.
fn rows(draft: &mut Draft, k: usize, log: &Log, signals: &[&Signal]) {
    if log.table.malformed > 0 || signals.iter().any(|s| log.missing(s) > 0.0) {
        draft.guess("bad_rows", "skip", "some rows are cut off or lack numbers");
    }
    let repeated = signals.iter().map(|s| log.repeats(s).share).reduce(f64::min);
    if let Some(repeated) = repeated.filter(|share| *share > REPEATED && log.repeats_are_copies(signals)) {
        let why = format!("{:.0} % of the rows repeat the one before", 100.0 * repeated);
        draft.guess("repeats", "drop", &why);
    }
    let mut conditions: Vec<Condition> = Vec::new();
    if let Some(instances) = &log.instances {
        let why = format!("{} instruments are in this file; the first one", instances.numbers.len());
        conditions.push(Condition {
            column: instances.column,
            key: "equals",
            value: instances.numbers[0],
            why,
        });
    }
    let is_place = |s: &Signal| matches!(s.kind, Kind::Geodetic | Kind::Local);
    let position = signals.iter().copied().find(|s| is_place(s));
    // A depth in the columns of a position is valid when the position is.
    let is_within = |s: &&Signal| signals.iter().any(|own| s.columns.iter().any(|c| own.columns.contains(c)));
    let position = position.or_else(|| log.signals.iter().filter(|s| is_place(s)).find(is_within));
    conditions.extend(position.and_then(|position| validity(log, position)));
    draft.reads(k, conditions.iter().map(|c| c.column));
    let all: Vec<InlineTable> = conditions.iter().map(|c| c.table(log)).collect();
    let why: Vec<&str> = conditions.iter().map(|c| c.why.as_str()).collect();
    match <[InlineTable; 1]>::try_from(all) {
        Ok([only]) => draft.guess("valid", only, &why.join("; ")),
        Err(all) if all.is_empty() => {}
        Err(all) => draft.guess("valid", list(all), &why.join("; ")),
    }
}

/// A condition on rows, with its reason.
struct Condition {
    column: usize,
    key: &'static str,
    value: f64,
    why: String,
}

impl Condition {
    fn table(&self, log: &Log) -> InlineTable {
        let column = Value::from(log.table.columns[self.column].name.as_str());
        [("column", column), (self.key, number(&self.value.to_string()))]
            .into_iter()
            .collect()
    }
}

/// Returns true if a log of `fusion record` has these columns, by their names. Its samples are means over the interval
/// that ends at the stamp.
fn is_recorded(signal: &Signal, log: &Log) -> bool {
    let unit = if signal.kind == Kind::SpecificForce { "m/s^2" } else { "rad/s" };
    let written = ["x", "y", "z"].map(|axis| format!("{}_{axis} [{unit}]", signal.kind.channel()));
    signal.names(&log.table) == written
}

/// A velocity as speed and course; `None` for a velocity along axes.
fn over_ground(log: &Log, signal: &Signal) -> Option<Vec<(&'static str, Value)>> {
    let course_unit = signal.course?;
    let name = |k: usize| Value::from(log.table.columns[signal.columns[k].0].name.as_str());
    let column = |k: usize, unit: &str| -> Value {
        let entries = [("column", name(k)), ("unit", unit.into())];
        entries.into_iter().collect::<InlineTable>().into()
    };
    let mut body = vec![("speed", column(0, &signal.unit)), ("course", column(1, course_unit))];
    body.extend(signal.columns.get(2).map(|(_, is_up)| {
        let key = if *is_up { "up" } else { "down" };
        (key, column(2, &signal.unit))
    }));
    let missing = |k: usize| {
        let values = &log.table.columns[signal.columns[k].0].values;
        values.iter().filter(|v| !v.is_finite()).count()
    };
    // A vehicle at rest has no course.
    if missing(1) > missing(0) {
        let entries = [("column", name(1)), ("not_equals", "".into())];
        body.push(("valid", entries.into_iter().collect::<InlineTable>().into()));
    }
    Some(body)
}

/// The `latency` of a late channel \[s\].
fn latency(lag: Option<f64>) -> Option<(&'static str, Value)> {
    lag.filter(|lag| *lag > 0.0).map(|lag| ("latency", format!("{lag:.2} s").into()))
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

/// The condition that a position is valid.
fn validity(log: &Log, position: &Signal) -> Option<Condition> {
    let condition = |column, key, value, why| Some(Condition { column, key, value, why });
    let words: Vec<Words> = log.table.columns.iter().map(|c| Words::of(c.called())).collect();
    let first = words[position.columns[0].0].stem.split('_').next().unwrap_or_default().to_owned();
    let flag = words
        .iter()
        .position(|w| contains(&w.stem, &["valid"]) && w.stem.starts_with(&first));
    if let Some(k) = flag {
        return condition(k, "equals", 1.0, "guessed by its name".to_owned());
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
        if others > 0 && math::fract(usual) == 0.0 {
            let why = if is_flag {
                format!("guessed: of 0 and 1, 0 means no fix; {others} rows have it")
            } else {
                format!("guessed: the usual one; {others} rows have another")
            };
            return condition(k, "equals", usual, why);
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
    condition(position.columns.first()?.0, "not_equals", 0.0, share)
}
