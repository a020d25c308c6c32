//! Logs without a description: the probable meaning of their columns, their regularity, and the mounting of an
//! inertial unit in its vehicle. From this, a first design is written.
//!
//! ```text
//! files ── source/table ──▶ Log: clock, signals ──▶ Inspection: who is IMU, position, reference ──▶ page
//!                                                        imu, track, pair                      └─▶ design
//! ```
//!
//! Everything here is a guess and is shown with its reason. A run uses none of it: the written design is a text that
//! its owner corrects.
//!
//! Memory   all of the files, eight bytes for each cell

mod beside;
mod clock;
mod day;
mod design;
mod field;
mod frame;
mod imu;
mod log;
mod names;
mod numbers;
mod page;
mod pair;
mod signal;
mod size;
mod stance;
mod standing;
#[cfg(test)]
mod tests;
mod track;
mod turn;
mod turned;
mod types;
mod water;
mod words;
mod yaw;

pub use clock::{Clock, Form, Origin};
pub use day::Day;
pub use field::Field;
pub use imu::{Imu, Rest};
pub use log::{Instances, Log, Repeats};
pub(crate) use names::reported_by_name;
pub(crate) use numbers::{direction, median};
pub use pair::Pair;
pub use signal::{Kind, Signal};
pub use stance::Stances;
pub use standing::Standing;
use track::Odometer;
pub use track::Track;
pub use turned::Turned;
pub use water::Water;
pub(crate) use words::stated_unit;
pub use yaw::Yaw;

use fusion::config::{Diagnostic, Diagnostics};
use fusion::source::LogFormat;
use fusion::source::table::{LogTable, Role};
use signal::Kind::{AngularRate, Euler, Geodetic, Heading, Local, MagneticField, Quaternion, SpecificForce, Velocity};
use std::path::{Path, PathBuf};

/// No person runs faster for long \[m/s\].
const RUNNING: f64 = 10.0;
/// The largest speed that receivers report at rest \[m/s\].
const SLOW: f64 = 0.2;

/// Logs and their roles for a filter.
#[derive(Clone, Debug)]
pub struct Inspection {
    /// The files.
    pub logs: Vec<Log>,
    /// The inertial unit: its file and its properties.
    pub imu: Option<(usize, Imu)>,
    /// The positions that a filter would use.
    pub position: Option<(usize, Track)>,
    /// The log with the velocities of these positions, if they are in a separate file.
    pub velocity: Option<usize>,
    /// The positions that look like a ground truth.
    pub reference: Option<(usize, Track)>,
    /// The comparison of unit and positions.
    pub pair: Option<Pair>,
    /// The direction of a velocity along the body in the unit.
    pub turned: Option<Turned>,
    /// The recorded heading against the course, from the log that gives an attitude or a heading.
    pub yaw: Option<Yaw>,
    /// The magnetometer: its file, and its reading of the Earth's field or the reason why it is not used.
    pub field: Option<(usize, Result<Field, String>)>,
    /// The reference of each speed and body velocity, water or ground, as far as it is identifiable.
    pub water: Vec<(Kind, Water)>,
}

/// These files, and the log files in these folders, in the order of their names. If a folder contains only one folder,
/// that folder is read.
///
/// # Errors
/// A folder has no log, or cannot be read.
pub fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Diagnostics> {
    let mut all = Vec::new();
    for path in paths {
        if path.is_dir() {
            all.extend(inside(path)?);
        } else {
            all.push(path.clone());
        }
    }
    Ok(all)
}

fn inside(folder: &Path) -> Result<Vec<PathBuf>, Diagnostic> {
    let shown = folder.display();
    let entries = std::fs::read_dir(folder).map_err(|e| Diagnostic::error(format!("`{shown}` cannot be read: {e}")))?;
    let paths: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    let endings: Vec<&str> = LogFormat::all().iter().flat_map(|format| format.endings).copied().collect();
    let is_log = |p: &&PathBuf| p.is_file() && endings.iter().any(|e| p.to_string_lossy().ends_with(e));
    let mut logs: Vec<PathBuf> = paths.iter().filter(is_log).cloned().collect();
    logs.sort_unstable();
    if !logs.is_empty() {
        return Ok(logs);
    }
    let folders: Vec<String> = paths.iter().filter(|p| p.is_dir()).map(|p| format!("`{}`", p.display())).collect();
    let inner: Vec<&PathBuf> = paths.iter().filter(|p| p.is_dir()).collect();
    if let [only] = inner[..] {
        return inside(only);
    }
    let error = Diagnostic::error(format!("`{shown}` holds no log: no name ends in {}", endings.join(", ")));
    Err(if folders.is_empty() {
        error.help("name the files themselves")
    } else {
        error.help(format!("its folders are {}: name one of them", folders.join(", ")))
    })
}

impl Inspection {
    /// Reads the files and looks at them.
    ///
    /// # Errors
    /// All files that cannot be read.
    pub fn of(paths: &[PathBuf]) -> Result<Self, Diagnostics> {
        let (mut tables, mut d) = (Vec::new(), Diagnostics::new());
        for path in paths {
            match LogTable::read_all(path) {
                Ok(read) => tables.extend(read),
                Err(error) => d.extend(error.of_file()),
            }
        }
        clock::agree(&mut tables);
        d.unless_errors(Self::look(tables.into_iter().map(Log::of).collect()))
    }

    /// Looks at logs.
    #[must_use]
    pub fn look(mut logs: Vec<Log>) -> Self {
        day::give_days(&mut logs);
        bring_to_gps(&mut logs);
        let mut apart = logs.iter().position(has_velocity_alone);
        let (mut position, mut reference) = tracks(&logs, apart);
        let depth = logs.iter().find_map(frame::Depths::of);
        if let Some((_, track)) = &position
            && logs
                .iter_mut()
                .fold(false, |any, log| frame::settle(log, track, depth.as_ref()) | any)
        {
            apart = logs.iter().position(has_velocity_alone);
            (position, reference) = tracks(&logs, apart);
        }
        let velocity = apart.filter(|_| position.as_ref().is_some_and(|(k, _)| !logs[*k].has(Velocity)));
        if let Some((_, track)) = position.as_ref().or(reference.as_ref()) {
            bring_together(&mut logs, track);
        }
        if let Some((_, track)) = &position {
            logs.iter_mut().for_each(|log| water::settle_speed(log, track));
        }
        let best = position.as_ref().or(reference.as_ref());
        let reported = best.filter(|(_, track)| track.is_reported).map(|(_, track)| track);
        let wheels = logs.iter().find_map(|log| Odometer::of(log, Kind::Speed));
        let stands = |t: f64| match (reported, &wheels) {
            (Some(track), _) => track.speed(t).map(|speed| speed < SLOW),
            (None, Some(wheels)) => wheels.stands(t),
            // Fixes tell motion, but not rest.
            (None, None) => best.and_then(|(_, track)| track.moves(t)).map(|_| false),
        };
        let mut imu = units(&logs).first().and_then(|k| Some((*k, Imu::of(&logs[*k], &stands)?)));
        // A unit that swings now and then, but is faster than a runner, is not on a foot.
        if let Some((_, imu)) = imu.as_mut().filter(|_| reported.is_some_and(|track| track.top_speed() > RUNNING)) {
            imu.stances = None;
        }
        let pair = imu.as_ref().zip(best).and_then(|((k, imu), (_, track))| {
            let log = &logs[*k];
            let (force, rate) = (log.values(SpecificForce)?, log.values(AngularRate)?);
            Pair::of(log.stamps(), &force, &rate, imu.gravity, imu.up, track)
        });
        let turned = imu.as_ref().and_then(|(k, imu)| {
            let (unit, body) = (
                &logs[*k],
                logs.iter().find(|log| log.has(Kind::BodyVelocity) && log.clock.is_some())?,
            );
            let (force, rate) = (unit.values(SpecificForce)?, unit.values(AngularRate)?);
            let velocity = body.values(Kind::BodyVelocity)?;
            Turned::of((unit.stamps(), &force, &rate), imu.gravity, imu.up, (body.stamps(), &velocity))
        });
        let water = position.as_ref().map_or_else(Vec::new, |(_, track)| {
            let of = |kind| Some((kind, Water::of(&logs.iter().find_map(|log| Odometer::of(log, kind))?, track)?));
            [Kind::Speed, Kind::BodyVelocity].into_iter().filter_map(of).collect()
        });
        let mut looked = Self {
            logs,
            imu,
            position,
            velocity,
            reference,
            pair,
            turned,
            yaw: None,
            field: None,
            water,
        };
        looked.yaw = looked.heading();
        looked.field = looked.magnetometer();
        looked
    }

    /// The first log with a heading, unless it belongs to positions that are not used.
    fn heading_log(&self) -> Option<usize> {
        let is_used = |k: usize| self.position.as_ref().is_some_and(|(own, _)| *own == k);
        let has_positions = |k: usize| self.logs[k].has(Geodetic) || self.logs[k].has(Local);
        self.with(Heading).filter(|k| is_used(*k) || !has_positions(*k))
    }

    /// The Earth's field and the log with it.
    fn earth_field(&self) -> Option<(usize, Field)> {
        let (k, field) = self.field.as_ref()?;
        Some((*k, *field.as_ref().ok()?))
    }

    /// The current, north and east \[m/s\], if a speed of this kind is a speed through the water: as found, or unknown
    /// if only the name says so.
    fn current(&self, of: Kind) -> Option<[f64; 2]> {
        self.found_current(of).or_else(|| self.is_of_water(of).then_some([0.0; 2]))
    }

    /// Whether the name of a column says that a speed of this kind is through the water.
    fn is_of_water(&self, of: Kind) -> bool {
        let Some(k) = self.with(of) else { return false };
        let names = self.logs[k].signal(of).map_or_else(Vec::new, |s| s.names(&self.logs[k].table));
        let says = |name: &String| words::contains(&words::Words::of(name).stem, &["stw", "water"]);
        names.iter().any(says)
    }

    /// The current, north and east \[m/s\], if the track shows that a speed of this kind is through the water.
    fn found_current(&self, of: Kind) -> Option<[f64; 2]> {
        self.water.iter().find(|(kind, _)| *kind == of).and_then(|(_, water)| match water {
            Water::Through(current) => Some(*current),
            Water::Ground => None,
        })
    }

    /// Whether the track shows that a speed of this kind is over ground.
    fn is_over_ground(&self, of: Kind) -> bool {
        self.water.iter().any(|(kind, water)| *kind == of && *water == Water::Ground)
    }

    /// The first magnetometer, if it reads the Earth's field.
    fn magnetometer(&self) -> Option<(usize, Result<Field, String>)> {
        let (unit, imu) = self.imu.as_ref()?;
        let bias = imu.rest.as_ref().map_or([0.0; 3], |rest| rest.bias);
        let k = self.with(MagneticField)?;
        Some((k, Field::of(&self.logs[k], &self.logs[*unit], bias)?))
    }

    /// The heading of the attitude reference against the course.
    fn heading(&self) -> Option<Yaw> {
        let (k, kind, axis) = match self.with(Euler) {
            Some(k) => (k, Euler, 2),
            None => (self.heading_log()?, Heading, 0),
        };
        let yaw: Vec<f64> = self.logs[k].values(kind)?.iter().map(|v| v[axis]).collect();
        Yaw::of(self.logs[k].stamps(), &yaw, &self.position.as_ref()?.1)
    }

    /// The first log with this kind and with time, except the reference. An instrument comes before the estimate of a
    /// filter.
    fn with(&self, kind: Kind) -> Option<usize> {
        let is_reference = |k: usize| self.reference.as_ref().is_some_and(|(r, _)| *r == k);
        let mut all = (0..self.logs.len()).filter(|k| !is_reference(*k) && self.logs[*k].clock.is_some() && self.logs[*k].has(kind));
        // An estimate by type is not a measurement. Only its attitude may replace one.
        let is_attitude = matches!(kind, Euler | Quaternion | Heading);
        let may_stand = |role: Role| role == Role::Unknown || (role == Role::Estimate && is_attitude);
        let first = all.clone().find(|k| may_stand(self.logs[*k].table.role));
        all.find(|k| !self.logs[*k].is_estimate()).or(first)
    }

    /// The reasons why no filter can be made from these files, in sentences.
    #[must_use]
    pub fn missing(&self) -> Vec<String> {
        let mut all = Vec::new();
        for log in self.logs.iter().filter(|l| l.clock.is_none()) {
            all.push(clock::why_none(&log.table));
            if log.has(SpecificForce) || log.has(AngularRate) {
                all.push(format!(
                    "if `{}` is of a unit at rest whose samples are even, `fusion allan {} --rate \"100 Hz\"` with its rate and \
                     columns tells the noises",
                    log.name(),
                    log.table.path.display()
                ));
            }
        }
        for log in &self.logs {
            let resets = log.clock.as_ref().map_or(0, |c| c.resets);
            if resets > 0 {
                all.push(format!(
                    "`{}`: time goes back by more than a second {resets} times: several recordings in one file; declare \
                     `time.plus` with the column that numbers them",
                    log.name()
                ));
            }
        }
        let is_unit = |log: &&Log| log.clock.is_some() && log.has(SpecificForce) && log.has(AngularRate);
        for log in self.logs.iter().filter(is_unit).filter(|_| self.imu.is_none()) {
            all.push(format!(
                "a second of the inertial unit in `{}` with four samples and no gap: without one it is unknown which axis points up",
                log.name()
            ));
        }
        let has = |kind| self.logs.iter().any(|log| log.has(kind));
        let is_inertial = has(SpecificForce) && has(AngularRate);
        if !(is_inertial || has(Euler) || has(Kind::Speed) || has(Kind::Wheels)) {
            all.push("what drives a filter: angular rates with specific forces, an attitude, or a speed".to_owned());
        }
        if self.position.is_none() {
            let walks = self.imu.as_ref().is_some_and(|(_, imu)| imu.stances.is_some());
            let what = if walks {
                "positions: without them the way of the foot begins at zero"
            } else {
                "positions: without them a filter gives the attitude only"
            };
            all.push(what.to_owned());
        }
        let is_flat = |log: &Log| log.signal(Geodetic).is_some_and(|s| s.columns.len() < 3);
        if let Some((k, _)) = self
            .position
            .as_ref()
            .filter(|(k, _)| self.imu.is_some() && is_flat(&self.logs[*k]))
        {
            all.push(format!(
                "the height of the positions in `{}`: no column beside latitude and longitude is called so. If one is, name it `height_m`; \
                 without it the origin is at 0 m, and no barometer is used",
                self.logs[*k].name()
            ));
        }
        all
    }
}

/// Seconds since 1970 or 1980 are larger in any log of this century.
const ABSOLUTE: f64 = 6e8;

/// Brings clocks that count since 1970 to GPS time, if other clocks are in GPS time.
fn bring_to_gps(logs: &mut [Log]) {
    let of_gps = logs.iter().filter_map(|log| log.clock.as_ref()).filter(|c| c.origin == Origin::Gps);
    let spans = of_gps.map(Clock::span);
    let Some(all) = spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
        return;
    };
    let clocks = logs.iter_mut().filter_map(|log| log.clock.as_mut());
    for clock in clocks.filter(|c| c.origin == Origin::Unknown && c.span().0 > ABSOLUTE) {
        clock.bring_to_gps(all);
    }
}

/// Shifts the stamps of the unit if its turns agree with those of the positions only at another time.
fn bring_together(logs: &mut [Log], track: &Track) {
    let Some(k) = units(logs).first().copied() else { return };
    let log = &logs[k];
    let has_positions = log.has(Geodetic) || log.has(Local);
    let (Some(force), Some(rate), Some(imu)) = (log.values(SpecificForce), log.values(AngularRate), Imu::of(log, &|_| None)) else {
        return;
    };
    let pair = Pair::of(log.stamps(), &force, &rate, imu.gravity, imu.up, track);
    if has_positions || pair.is_some_and(|pair| pair.is_related()) {
        return;
    }
    let lag = pair::apart(log.stamps(), &rate, imu.gravity, track);
    if let (Some(lag), Some(clock)) = (lag, &mut logs[k].clock) {
        let stamps = [clock.span().0, track.t.first().copied().unwrap_or(f64::NAN)];
        clock.shift(leap_seconds(lag, stamps).unwrap_or(lag));
    }
}

/// The leap seconds between two clocks that show the date, one of them GPS time and one UTC, if they are about `lag`
/// apart. The rest of the lag is then a delay of the positions. `stamps` is a stamp of each.
fn leap_seconds(lag: f64, stamps: [f64; 2]) -> Option<f64> {
    /// Receivers are late by up to half a second, and the search has steps of a quarter.
    const NEAR: f64 = 0.75;
    /// 1980-01-06 in Unix time: where GPS time begins.
    const GPS: f64 = 315_964_800.0;
    if !stamps.iter().all(|t| *t > ABSOLUTE) {
        return None;
    }
    // A count may be of either time: the leap seconds of both dates.
    let counts = [stamps[0], stamps[0] + GPS];
    let leaps = counts
        .into_iter()
        .filter_map(|unix| Some(fusion::source::table::gps_of_unix(unix)? - unix + GPS));
    let near = leaps.filter(|leap| (lag.abs() - leap).abs() <= NEAR);
    near.min_by(|a, b| (lag.abs() - a).abs().total_cmp(&(lag.abs() - b).abs()))
        .map(|leap| leap.copysign(lag))
}

/// The logs of inertial units, the unit with the smallest rates first. Two units on one vehicle turn alike, and the
/// better unit has the smaller biases. A unit that is recorded too slowly comes last.
fn units(logs: &[Log]) -> Vec<usize> {
    let is_unit = |k: &usize| logs[*k].clock.is_some() && logs[*k].has(SpecificForce) && logs[*k].has(AngularRate);
    let is_slow = |k: usize| logs[k].rate() < design::INTEGRABLE;
    let mut all: Vec<(usize, f64)> = (0..logs.len())
        .filter(is_unit)
        .map(|k| {
            let rates = logs[k].values(AngularRate).unwrap_or_default();
            (k, numbers::median(rates.into_iter().map(numbers::norm)))
        })
        .collect();
    all.sort_by(|a, b| is_slow(a.0).cmp(&is_slow(b.0)).then(a.1.total_cmp(&b.1)));
    all.into_iter().map(|(k, _)| k).collect()
}

/// Returns true if a log has velocities and no positions.
fn has_velocity_alone(log: &Log) -> bool {
    log.clock.is_some() && log.has(Velocity) && !(log.has(Geodetic) || log.has(Local)) && !log.is_estimate()
}

type Found = Option<(usize, Track)>;

/// The positions to use, and those that look like a ground truth. A ground truth among several comes with an attitude,
/// or else reports the smallest 1σ. If none reports a 1σ, it has a tenth of the scatter. `apart` is a log with
/// velocities only.
fn tracks(logs: &[Log], apart: Option<usize>) -> (Found, Found) {
    // If a receiver wrote positions, those of another filter are neither measurements nor a truth.
    let is_received = logs.iter().any(|log| log.clock.is_some() && log.is_of_receiver());
    let is_left = |log: &Log| is_received && log.is_estimate() && log.table.role != Role::Truth;
    let has = |k: &usize| (logs[*k].has(Geodetic) || logs[*k].has(Local)) && !is_left(&logs[*k]);
    let mut all: Vec<(usize, Track)> = (0..logs.len())
        .filter(has)
        .filter_map(|k| Some((k, Track::of(&logs[k], apart.map(|a| &logs[a]))?)))
        .collect();
    let quality = |(k, track): &(usize, Track)| {
        let has_attitude = logs[*k].has(Quaternion) || logs[*k].has(Euler);
        (!has_attitude, track.claimed.unwrap_or(f64::INFINITY))
    };
    let is_truth = |k: usize| logs[k].table.role == Role::Truth;
    let is_better = |best: &(usize, Track), other: &(usize, Track)| {
        // By the type of its messages it is a measurement.
        if logs[best.0].table.role == Role::Measurement {
            return false;
        }
        let is_unclaimed = best.1.claimed.or(other.1.claimed).is_none();
        quality(best) < quality(other) || (is_unclaimed && 10.0 * best.1.scatter < other.1.scatter)
    };
    let rank = |found: &(usize, Track)| (quality(found), found.1.scatter);
    all.sort_by(|a, b| rank(a).partial_cmp(&rank(b)).unwrap_or(core::cmp::Ordering::Equal));
    if let Some(truth) = all.iter().position(|(k, _)| is_truth(*k)) {
        let truth = all.remove(truth);
        return match all.into_iter().find(|(k, _)| !is_truth(*k)) {
            None => (Some(truth), None),
            measured => (measured, Some(truth)),
        };
    }
    let mut all = all.into_iter();
    match (all.next(), all.next()) {
        (Some(best), Some(other)) if is_better(&best, &other) => (Some(other), Some(best)),
        (first, _) => (first, None),
    }
}
