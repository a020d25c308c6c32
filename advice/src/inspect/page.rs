//! The results as tables.

use super::imu::Rest;
use super::log::Log;
use super::numbers::{Vec3, norm};
use super::signal::Kind::{BodyVelocity, MagneticField, Speed};
use super::{Clock, Form, Inspection, Pair, Track};
use fusion::source::table::Role;
use fusion_core::math;
use fusion_tables::{Cell, Column, Page, Section, Table, Unit};
use std::collections::BTreeSet;
use std::path::Path;

impl Inspection {
    /// The results as tables.
    #[must_use]
    pub fn page(&self) -> Page {
        let all = |add: fn(&mut Table, &Log), mut t: Table| {
            self.logs.iter().for_each(|log| add(&mut t, log));
            t
        };
        // All topics of a file have its notes.
        let of_files: BTreeSet<String> = self.logs.iter().flat_map(Log::of_file).collect();
        let mut sections = vec![
            self.logs
                .iter()
                .flat_map(|log| [log.several(), log.side_by_side(), log.of_day(), log.of_stamps(), log.recordings()])
                .flatten()
                .chain(of_files)
                .fold(Section::new("Files", [all(file, files())]), Section::note),
            Section::new("Arrays", [all(arrays, Table::new(["file", "array", "shape"].map(Column::text)))]),
            Section::new("Quantities", [all(quantities, columns())]),
            Section::new("Not used", [self.not_used()]),
            Section::new("Inertial unit", [self.unit()]),
            Section::new("At rest", [self.rest()]),
            Section::new("Stances of a foot", [self.stances()]),
            self.two_tracks()
                .into_iter()
                .fold(Section::new("Positions", [self.positions()]), Section::note),
            Section::new("Attitude and positions", [self.headings()]),
            Section::new(
                "Unit and positions",
                [self.pair.as_ref().map_or_else(Table::list, |p| self.together(p))],
            ),
        ];
        let missing = self.missing();
        if !missing.is_empty() {
            let section = Section::new("Missing", []);
            sections.push(missing.into_iter().fold(section, Section::note));
        }
        sections.retain(|s| !s.is_empty());
        Page {
            sections,
            ..Page::default()
        }
    }

    /// The columns that a first design does not read, and why.
    fn not_used(&self) -> Table {
        let mut t = Table::new([Column::text("file"), Column::text("columns"), Column::text("why")]);
        let design = self.written(Path::new("."));
        let read = |k: usize, column: usize| design.as_ref().is_some_and(|(_, read)| read.contains(&(k, column)));
        for (k, log) in self.logs.iter().enumerate() {
            if log.table.role == Role::Other {
                t.row([
                    log.name(),
                    "all".to_owned(),
                    "no measurements, by the type of the messages".to_owned(),
                ]);
                continue;
            }
            let stamps = log.clock.as_ref().map_or_else(Vec::new, |c| c.columns(&log.table));
            let mut reasons: Vec<(String, Vec<&str>)> = Vec::new();
            for (column, of) in log.table.columns.iter().enumerate() {
                let why = self.why_unused(k, column, design.is_some());
                let Some(why) = why.filter(|_| !read(k, column) && !stamps.contains(&column)) else {
                    continue;
                };
                match reasons.iter_mut().find(|(reason, _)| *reason == why) {
                    Some((_, names)) => names.push(&of.name),
                    None => reasons.push((why, vec![&of.name])),
                }
            }
            for (why, names) in reasons {
                t.row([log.name(), names.join(" "), why]);
            }
        }
        t
    }

    /// Why a design does not read a column; `None` for a quantity without a design.
    fn why_unused(&self, k: usize, column: usize, is_designed: bool) -> Option<String> {
        let log = &self.logs[k];
        let is_field = || log.signal(MagneticField).is_some_and(|s| s.columns.iter().any(|c| c.0 == column));
        let refused = self
            .field
            .as_ref()
            .filter(|(of, _)| *of == k)
            .and_then(|(_, field)| field.as_ref().err());
        match refused.filter(|_| is_designed && is_field()) {
            Some(why) => Some(format!("{}: {why}", MagneticField.name())),
            None => log.why_unused(column, is_designed),
        }
    }

    fn unit(&self) -> Table {
        let mut t = Table::list();
        let Some((k, imu)) = &self.imu else { return t };
        t.row(["file", &self.logs[*k].name()]);
        t.row(["up", &format!("{}: mean force {} m/s²", axis(imu.up), vector(imu.gravity, 2))]);
        t.row_in(Unit::of_si("rad"), [Cell::text("tilt of that axis"), Cell::Real(imu.tilt)]);
        let found = self.earth_field().map(|(_, field)| (field.strength, field.dip)).or(imu.field);
        let found = found.map(|(strength, dip)| format!("{:.1} uT, dips by {:.1} deg", 1e6 * strength, dip.to_degrees()));
        let told = self.field.as_ref().map(|(_, field)| match field {
            Ok(field) => format!("the gyros explain {:.0} % of its turns", 100.0 * field.explained),
            Err(why) => why.clone(),
        });
        let said: Vec<String> = found.into_iter().chain(told).collect();
        if !said.is_empty() {
            t.row(["magnetic field", &said.join("; ")]);
        }
        t.row_in(Unit::of_si("m/s^2"), [Cell::text("|force|"), Cell::Fixed(norm(imu.gravity), 3)]);
        t
    }

    fn rest(&self) -> Table {
        let mut t = Table::list();
        let Some((_, imu)) = &self.imu else { return t };
        let Some(r) = &imu.rest else {
            t.row(["rest", "none found: no two seconds in a row that differ from motion"]);
            return t;
        };
        t.row([Cell::text("share of the log"), Cell::Share(r.share)]);
        t.row(["first", &format!("from {:.1} s for {:.1} s", self.local(r.first.0), r.first.1)]);
        t.row(["accelerometer std", &format!("{} m/s²", vector(r.accel_std, 3))]);
        t.row(["gyro std", &format!("{} deg/s", vector(degrees(r.gyro_std), 3))]);
        t.row(["gyro bias", &format!("{} deg/s", vector(degrees(r.bias), 3))]);
        t.row(["noise", &format!("{:.2e} m/s²/√Hz, {:.2e} rad/s/√Hz", r.accel_noise, r.gyro_noise)]);
        t.row(["in motion", &separation(r)]);
        t
    }

    fn stances(&self) -> Table {
        let mut t = Table::list();
        let Some(s) = self.imu.as_ref().and_then(|(_, imu)| imu.stances.as_ref()) else {
            return t;
        };
        t.row([Cell::text("count"), Cell::from(s.count)]);
        t.row_in(Unit::of_si("s"), [Cell::text("one every"), Cell::Real(s.period)]);
        t.row_in(Unit::of_si("s"), [Cell::text("each lasts"), Cell::Real(s.duration)]);
        t
    }

    /// A stamp as time since the first one of all files.
    pub(super) fn local(&self, stamp: f64) -> f64 {
        stamp - self.begin()
    }

    /// The first stamp of all files \[s\].
    pub(super) fn begin(&self) -> f64 {
        let first = |log: &Log| Some(log.clock.as_ref()?.span().0);
        self.logs.iter().filter_map(first).fold(f64::INFINITY, f64::min)
    }

    fn positions(&self) -> Table {
        let mut t = Table::new([
            Column::text("file"),
            Column::text("taken as"),
            Column::with_unit("rate", Unit::shown("Hz")),
            Column::with_unit("way", Unit::of_si("m")),
            Column::with_unit("95 % of speeds", Unit::of_si("m/s")),
            Column::with_unit("scatter", Unit::of_si("m")),
            Column::with_unit("1σ reported", Unit::of_si("m")),
            Column::text("velocity / change of position"),
        ]);
        let mut row = |(k, track): &(usize, Track), role: &str| {
            let agreement = track.agreement.map_or_else(String::new, |a| {
                let told = if a[2].is_nan() { &a[..2] } else { &a[..] };
                told.iter().map(|x| format!("{x:.2}")).collect::<Vec<_>>().join(", ")
            });
            t.row([
                Cell::text(self.logs[*k].name()),
                Cell::text(role),
                Cell::Real(track.rate()),
                Cell::Real(track.way),
                Cell::Real(track.top_speed()),
                Cell::Real(track.scatter),
                Cell::real(track.claimed),
                Cell::text(agreement),
            ]);
        };
        self.position.iter().for_each(|p| row(p, "measurements"));
        self.reference
            .iter()
            .for_each(|p| row(p, "reference: it looks like a ground truth"));
        t
    }

    /// A note about positions that are two tracks.
    fn two_tracks(&self) -> Option<String> {
        let (k, track) = self.position.as_ref()?;
        let apart = track.apart?;
        Some(format!(
            "`{}` holds two tracks: fixes jump by up to {apart:.0} m and come back. Way, speeds and scatter are those of the steps without a \
             jump. One track is false, such as the echo of an acoustic signal: the gate `hypotheses` tells which",
            self.logs[*k].name()
        ))
    }

    fn headings(&self) -> Table {
        let mut t = Table::list();
        let Some(yaw) = self.yaw else { return t };
        let sense = if yaw.is_clockwise { "clockwise" } else { "anti-clockwise" };
        if !yaw.is_decided() {
            t.row([
                Cell::text("heading counts"),
                Cell::text("not decided: it does not follow the course"),
            ]);
            t.row([Cell::text("agreement with the course"), Cell::Fixed(yaw.agreement, 3)]);
            return t;
        }
        t.row(["heading counts", sense]);
        t.row_in(Unit::of_si("rad"), [Cell::text("course minus heading"), Cell::Real(yaw.offset)]);
        t.row([Cell::text("agreement with the course"), Cell::Fixed(yaw.agreement, 3)]);
        t
    }

    fn together(&self, pair: &Pair) -> Table {
        let mut t = Table::list();
        let turn = if !pair.agrees() && pair.climb > 0.6 {
            "they do not follow the course, though the force agrees with the climb: the nose does not follow the way, as of a multicopter, or \
             of a boat in waves"
        } else if !pair.agrees() {
            "they do not follow the course: it is noisy, or the nose does not follow the way"
        } else if pair.slope < 0.0 {
            "the rate counts against the course: a sign is wrong, or a left-handed sensor"
        } else {
            "the rate counts as the course does, clockwise about down"
        };
        t.row([
            "turns",
            &format!("{turn} (slope {:.3}, correlation {:.3})", pair.slope, pair.correlation),
        ]);
        let clock = self.imu.as_ref().and_then(|(k, _)| self.logs[*k].clock.as_ref());
        if let Some(clock) = clock.filter(|c| c.shift != 0.0) {
            let moved = format!("{:.2} s was added to the stamps of the unit: there the turns agree", clock.shift);
            t.row(["clocks apart", &moved]);
        }
        if let Some(lag) = pair.by_force.filter(|_| !pair.agrees()) {
            let late = format!("{lag:.2} s, by the length of the force, alike in every third; positions may be late by another time");
            t.row(["velocity or course is late by", &late]);
        } else if !pair.is_related() {
            t.row(["velocity or course is late by", "not decided: the turns do not agree"]);
        } else {
            t.row([
                "velocity or course is late by",
                &format!("{:.2} s; positions may be late by another time", pair.lag),
            ]);
        }
        if let Some((first, last)) = pair.lags {
            t.row(["in the first and the last third", &format!("{first:.2} s, {last:.2} s")]);
        }
        for (kind, [north, east]) in [Speed, BodyVelocity]
            .into_iter()
            .filter_map(|kind| Some((kind, self.found_current(kind)?)))
        {
            let current = format!("through the water, with a current of {north:.2} m/s north, {east:.2} m/s east");
            let what = if kind == Speed { "the speed is" } else { "the body velocity is" };
            t.row([what, &current]);
        }
        let sideways = format!(
            "the velocity changes by {:.2} m/s a second (1σ) without a turn of the unit",
            pair.slip
        );
        t.row(["sideways", &sideways]);
        if let (None, Some((_, correlation))) = (pair.ahead(), pair.forward) {
            t.row(["ahead", &format!("not decided (correlation {correlation:.2})")]);
        }
        if let (Some((angle, correlation)), Some((_, imu))) = (pair.ahead(), &self.imu) {
            let (a, b) = super::pair::horizontal(imu.up);
            let (c, s) = (math::cos(angle), math::sin(angle));
            let ahead = vector([0, 1, 2].map(|i| a[i] * c + b[i] * s), 3);
            t.row(["ahead", &format!("{ahead} in sensor axes (correlation {correlation:.2})")]);
        }
        t
    }
}

/// How well the rest test separates rest from motion.
fn separation(r: &Rest) -> String {
    if r.passing.is_nan() {
        return "it never moves".to_owned();
    }
    let share = 100.0 * r.passing;
    format!("{share:.1} % of the windows pass limits of {} × these deviations", r.times)
}

pub(super) fn axis((k, is_negative): (usize, bool)) -> String {
    let sign = if is_negative { "-" } else { "" };
    format!("{sign}{}", ["x", "y", "z"][k])
}

pub(super) fn vector(v: Vec3, decimals: usize) -> String {
    v.map(|x| format!("{x:.decimals$}")).join(", ")
}

pub(super) fn degrees(v: Vec3) -> Vec3 {
    v.map(f64::to_degrees)
}

fn files() -> Table {
    Table::new([
        Column::text("file"),
        Column::number("rows"),
        Column::text("time"),
        Column::with_unit("rate", Unit::shown("Hz")),
        Column::number("jitter"),
        Column::with_unit("length", Unit::of_si("s")),
        Column::number("gaps"),
        Column::with_unit("longest", Unit::of_si("s")),
        Column::number("equal"),
        Column::number("back"),
        Column::number("resets"),
        Column::number("not sound"),
    ])
}

fn file(t: &mut Table, log: &Log) {
    let name = Cell::text(log.name());
    let rows = Cell::from(log.table.rows());
    let Some(c) = &log.clock else {
        return t.row([name, rows, Cell::text("none found")]);
    };
    let time = match c.form {
        Form::Even => "evenly spaced".to_owned(),
        Form::Calendar if c.day.is_some() => format!("{} time of day", stamp_names(log, c)),
        Form::Calendar => format!("{} calendar", stamp_names(log, c)),
        Form::Counter => format!("{} counts rows", stamp_names(log, c)),
        _ => format!("{} {}", stamp_names(log, c), c.unit),
    };
    t.row([
        name,
        rows,
        Cell::text(time),
        Cell::Real(c.rate),
        Cell::Share(c.jitter),
        Cell::Seconds(log.duration()),
        Cell::from(c.gaps),
        Cell::Real(c.longest.0),
        Cell::from(c.ties),
        Cell::from(c.backwards),
        Cell::from(c.resets),
        Cell::from(log.table.malformed),
    ]);
}

/// The columns of the stamps.
fn stamp_names(log: &Log, clock: &Clock) -> String {
    let names = clock
        .columns(&log.table)
        .into_iter()
        .map(|k| format!("`{}`", log.table.columns[k].name));
    names.collect::<Vec<_>>().join(" + ")
}

fn arrays(t: &mut Table, log: &Log) {
    for (name, shape) in &log.table.arrays {
        t.row([log.name(), name.clone(), shape.clone()]);
    }
}

fn columns() -> Table {
    Table::new([
        Column::text("file"),
        Column::text("quantity"),
        Column::text("columns"),
        Column::text("unit"),
        Column::number("repeated"),
        Column::with_unit("longest", Unit::of_si("s")),
        Column::number("empty"),
        Column::text("why"),
    ])
}

fn quantities(t: &mut Table, log: &Log) {
    for s in &log.signals {
        let repeats = log.repeats(s);
        t.row([
            Cell::text(log.name()),
            Cell::text(s.kind.name()),
            Cell::text(s.names(&log.table).join(" ")),
            Cell::text(&s.unit),
            Cell::Share(repeats.share),
            Cell::Real(repeats.longest),
            Cell::Share(log.missing(s)),
            Cell::text(&s.why),
        ]);
    }
}
