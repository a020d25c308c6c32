//! A first design from guesses, with a comment at every guess.
//!
//! `template.toml` has the parts. The code selects parts, and edits them with typed values and reasons. `draft.rs` makes
//! the text.

mod attitude;
mod draft;
mod odometry;
mod reckoning;
mod sensors;
mod sources;
mod strapdown;
mod tracks;

use self::draft::Draft;
use super::signal::Kind::{AngularRate, Euler, Geodetic, Local, SpecificForce, Speed, YawRate};
use super::{Clock, Form, Inspection, Kind, Log, Track};
use fusion::config::Diagnostic;
use fusion_core::math;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Slower units cannot be integrated \[Hz\].
pub(super) const INTEGRABLE: f64 = 20.0;
/// Faster fixes are thinned; the rest judges the filter \[Hz\].
const WITHHELD: f64 = 1.9;

/// The input that drives the filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Driver {
    /// An odometer and a rate of turn, or the speeds of both sides.
    Odometer,
    /// An inertial unit with positions.
    Inertial,
    /// An attitude reference with positions.
    Attitude,
    /// An inertial unit on a foot, without positions.
    Foot,
    /// An inertial unit alone.
    Gyros,
}

/// The source of the initial heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    /// The course over ground, which the nose follows.
    Course,
    /// A recorded heading.
    Heading,
    /// A magnetometer.
    Field,
    Nobody,
}

impl Inspection {
    /// A first design as text, to be saved in `folder`.
    ///
    /// # Errors
    /// Names the missing quantities.
    pub fn design(&self, folder: &Path) -> Result<String, Diagnostic> {
        self.written(folder).map(|(text, _)| text).ok_or_else(|| {
            Diagnostic::error("no design can be guessed from these files").help(
                "declare what the table `Missing` names, in a design of `fusion new`; or give the columns names that say quantity, axis and \
                 unit, such as `acc_x_mps2`",
            )
        })
    }

    /// A first design and the columns that it reads, each as the numbers of its log and of its column.
    pub(super) fn written(&self, folder: &Path) -> Option<(String, BTreeSet<(usize, usize)>)> {
        let resets = |log: &Log| log.clock.as_ref().is_some_and(|c| c.resets > 0);
        let driver = self.driver().filter(|_| !self.logs.iter().any(resets))?;
        let mut draft = Draft::default();
        self.head(&mut draft, folder, driver);
        match driver {
            Driver::Odometer => self.odometry(&mut draft),
            Driver::Inertial => self.strapdown(&mut draft),
            Driver::Attitude => self.reckoning(&mut draft),
            Driver::Foot => self.walk(&mut draft),
            Driver::Gyros => self.attitude(&mut draft),
        }
        self.judge(&mut draft);
        Some(draft.finish())
    }

    fn driver(&self) -> Option<Driver> {
        let rate = self.imu.as_ref().map_or(0.0, |(k, _)| self.logs[*k].rate());
        let has = |kind| self.with(kind).is_some();
        let turns = has(YawRate) || (has(AngularRate) && self.imu.is_some());
        let is_placed = self.position.is_some();
        let is_inertial = is_placed && has(SpecificForce) && rate >= INTEGRABLE;
        // In the plane an odometer is better than a unit, unless a velocity over ground shows the drift of the unit.
        let has_velocity = self.position.as_ref().is_some_and(|(_, track)| track.is_reported);
        let walks = self.imu.as_ref().is_some_and(|(_, imu)| imu.stances.is_some());
        // The attitude of another filter does not replace a unit in the files.
        let has_unit = self.logs.iter().any(|log| log.has(SpecificForce) && log.has(AngularRate));
        let is_measured = self.with(Euler).is_some_and(|k| !(has_unit && self.logs[k].is_estimate()));
        let candidates = [
            (is_inertial && has_velocity, Driver::Inertial),
            (is_inertial && self.is_of_water(Speed), Driver::Inertial),
            (is_placed && has(Speed) && turns, Driver::Odometer),
            (is_inertial, Driver::Inertial),
            (is_placed && is_measured, Driver::Attitude),
            (is_placed && self.sides().is_some(), Driver::Odometer),
            (rate >= INTEGRABLE && walks, Driver::Foot),
            (rate >= INTEGRABLE, Driver::Gyros),
        ];
        candidates.into_iter().find(|(fits, _)| *fits).map(|(_, driver)| driver)
    }

    /// The tables before the process.
    fn head(&self, draft: &mut Draft, folder: &Path, driver: Driver) {
        draft.part("head");
        let bank = self.position.as_ref().is_some_and(|(_, track)| track.apart.is_some());
        if driver == Driver::Inertial && self.told() == Told::Nobody {
            draft.part("bank of headings");
        } else if bank {
            draft.part("bank of tracks");
            if driver == Driver::Attitude {
                draft.set("bank.headings", 12);
            }
        }
        let what = match driver {
            Driver::Odometer if self.sides().is_some() => "speeds of both sides and positions, in the plane",
            Driver::Odometer => "odometer, rate of turn and positions, in the plane",
            Driver::Inertial => "inertial unit and positions",
            Driver::Attitude => "dead reckoning by an attitude reference, with positions",
            Driver::Foot => "inertial unit on a foot, which stands at every stride",
            Driver::Gyros => "attitude by gyros and gravity",
        };
        draft.within("run");
        draft.set("description", format!("first design: {what}"));
        draft.set("data_dir", self.data_dir(folder).display().to_string());
        let place = self.position.as_ref().or(self.reference.as_ref());
        if let Some([lat, lon, height]) = place.and_then(|(_, track)| track.origin) {
            draft.set("origin.latitude", format!("{:.7} deg", lat.to_degrees()));
            draft.set("origin.longitude", format!("{:.7} deg", lon.to_degrees()));
            draft.set("origin.height", format!("{height:.1} m"));
            draft.reason("origin", "the first position");
        }
        if driver == Driver::Odometer && self.has_recordings() {
            draft.set("restart_after", "5 s");
        }
        let is_fast = self.imu.as_ref().is_some_and(|(k, _)| self.logs[*k].rate() > 40.0);
        if is_fast {
            draft.set("output_rate", "10 Hz");
        }
    }

    /// Restarts a process with an input between recordings.
    fn apart(&self, draft: &mut Draft) {
        if self.has_recordings() {
            draft.set("input.longest_gap", "5 s");
        }
    }

    fn has_recordings(&self) -> bool {
        let is_one = |clock: &Clock| matches!(clock.form, Form::Recordings { .. });
        self.logs.iter().filter_map(|log| log.clock.as_ref()).any(is_one)
    }

    /// The common folder of all files, from `folder`.
    fn data_dir(&self, folder: &Path) -> PathBuf {
        let absolute = |p: &Path| std::fs::canonicalize(p).unwrap_or_else(|_| p.to_owned());
        let common = self.common();
        if absolute(&common) == absolute(folder) {
            PathBuf::from(".")
        } else {
            absolute(&common)
        }
    }

    /// The innermost folder that holds all files.
    fn common(&self) -> PathBuf {
        let folder = |log: &Log| log.table.path.parent().unwrap_or(Path::new("")).to_owned();
        let mut common = self.logs.first().map(folder).unwrap_or_default();
        while !self.logs.iter().all(|log| log.table.path.starts_with(&common)) && common.pop() {}
        if common.as_os_str().is_empty() {
            PathBuf::from(".")
        } else {
            common
        }
    }

    /// Whether the course can give the heading: the gyros turn as it does, and the velocity is reported.
    fn has_course(&self) -> bool {
        let is_fast = |track: &Track| track.is_reported && track.top_speed() > 3.0;
        self.position.as_ref().is_some_and(|(_, t)| is_fast(t)) && self.pair.is_some_and(|p| p.agrees())
    }

    /// The source of the initial heading.
    fn told(&self) -> Told {
        let has_heading = self.recorded_heading().is_some();
        let candidates = [
            (self.has_course(), Told::Course),
            (has_heading, Told::Heading),
            (self.earth_field().is_some(), Told::Field),
        ];
        let told = candidates.into_iter().find(|(is_told, _)| *is_told);
        told.map_or(Told::Nobody, |(_, told)| told)
    }

    /// The log with a heading that follows the course.
    fn recorded_heading(&self) -> Option<usize> {
        /// A compass on a vehicle that slips or drifts a little.
        const FOLLOWS: f64 = 0.8;
        self.heading_log().filter(|_| self.yaw.is_some_and(|yaw| yaw.agreement > FOLLOWS))
    }

    /// Whether the reported velocity has no vertical.
    fn has_flat_velocity(&self) -> bool {
        let of = self.velocity.or_else(|| self.position.as_ref().map(|(k, _)| *k));
        of.is_some_and(|k| self.logs[k].has_flat_velocity())
    }

    /// The name of the source of the reported velocity.
    fn velocity_source(&self) -> &'static str {
        if self.velocity.is_some() { "gnss_velocity" } else { "gnss" }
    }

    /// The tables that judge the filter.
    fn judge(&self, draft: &mut Draft) {
        let is_used = |k: usize| [&self.position, &self.reference].into_iter().flatten().any(|(used, _)| *used == k);
        let estimates = (0..self.logs.len()).filter(|k| self.logs[*k].is_estimate() && !is_used(*k));
        let with_places = estimates.filter(|k| self.logs[*k].has(Geodetic) || self.logs[*k].has(Local));
        let names: Vec<String> = with_places.map(|k| format!("`{}`", self.logs[k].name())).collect();
        if !names.is_empty() {
            draft.note(&format!(
                "By name the estimate of another filter, no measurement: {}. To compare with one, declare it as a",
                names.join(", ")
            ));
            draft.note("separate `[source]` and name it in `[reference]`: its errors are not independent of those of this filter.");
        }
        if self.position.is_none() && self.reference.is_none() {
            return self.judge_attitude(draft);
        }
        draft.part("judge");
        if let Some((k, track)) = &self.reference {
            draft.part("truth");
            self.source(draft, "reference", *k, &self.reference_kinds(*k), None);
            self.score(draft, "reference", *k, track);
        } else if let Some((k, track)) = self.position.as_ref().filter(|(_, track)| track.rate() > WITHHELD) {
            draft.part("withheld");
            let every = ("keep.except_every", track_stride(&self.logs[*k], track));
            self.source(draft, "withheld", *k, &self.reference_kinds(*k), Some(every));
            self.score(draft, "withheld", *k, track);
        } else {
            draft.part("no truth");
        }
    }

    fn score(&self, draft: &mut Draft, source: &str, k: usize, track: &Track) {
        let log = &self.logs[k];
        draft.part("reference");
        draft.set("source", source);
        let is_withheld = source == "withheld";
        let millimetres = |scatter: f64| format!("{:.3}", math::ceil(scatter * 1e3) * 1e-3);
        let why = if self.judges_with_reported(k) {
            draft.set("sigma.position.from_source", true);
            "as the file reports it"
        } else if is_withheld {
            draft.set("sigma.position", millimetres(self.white(log, track).0) + " m");
            "that of the fixes which the filter uses"
        } else {
            draft.set("sigma.position", millimetres(track.scatter.max(1e-3)) + " m");
            "the scatter of neighbouring positions"
        };
        let is_judged = self.reference_kinds(k).contains(&Kind::Velocity) && track.velocity_scatter.is_finite();
        let mut of_velocity = "";
        if log.has(Kind::VelocitySigma) && log.has(Kind::Velocity) {
            draft.set("sigma.velocity.from_source", true);
        } else if is_judged {
            draft.set("sigma.velocity", millimetres(track.velocity_scatter.max(1e-3)) + " m/s");
            of_velocity = "; of velocities the scatter of neighbouring ones";
        }
        if self.reference_kinds(k).contains(&Kind::AttitudeSigma) {
            draft.set("sigma.attitude.from_source", true);
        }
        draft.reason("sigma", &format!("{why}{of_velocity}"));
        if self.reference_kinds(k).iter().any(|s| matches!(s, Kind::Quaternion | Euler)) {
            draft.set("remove_mean_mounting", true);
        }
    }
}

/// The row stride that makes one fix a second of a file.
fn track_stride(log: &Log, track: &Track) -> usize {
    // Rows that repeat the previous fix count as rows of the file, too.
    let rows = log.rate() / track.rate();
    math::round(rows * track.rate()).max(2.0) as usize
}

/// Whether positions are local, not geodetic: from a room, a basin or USBL.
fn is_local(log: &Log) -> bool {
    log.has(Local) && !log.has(Geodetic)
}
