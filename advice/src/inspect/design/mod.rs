//! A first design from guesses: a text with a comment at every guess.

mod attitude;
mod odometry;
mod reckoning;
mod sensors;
mod sources;
mod strapdown;
mod toml;

use self::toml::Text;
use super::signal::Kind::{AngularRate, Euler, Geodetic, Local, SpecificForce, Speed, YawRate};
use super::{Clock, Form, Inspection, Log, Track};
use fusion::config::Diagnostic;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Slower units cannot be integrated \[Hz\].
const INTEGRABLE: f64 = 20.0;
/// Faster fixes are thinned; the rest judges the filter \[Hz\].
const WITHHELD: f64 = 1.9;

/// Why a filter restarts after a gap.
const RECORDINGS: &str = "guessed: each recording is a separate one; they are 10 s apart or more";

/// The input that drives the filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Driver {
    /// An odometer, and a rate of turn.
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
        let mut text = Text::default();
        self.head(&mut text, folder, driver);
        match driver {
            Driver::Odometer => self.odometry(&mut text),
            Driver::Inertial => self.strapdown(&mut text),
            Driver::Attitude => self.reckoning(&mut text),
            Driver::Foot => self.walk(&mut text),
            Driver::Gyros => self.attitude(&mut text),
        }
        self.judge(&mut text);
        Some(text.finish())
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
            (rate >= INTEGRABLE && walks, Driver::Foot),
            (rate >= INTEGRABLE, Driver::Gyros),
        ];
        candidates.into_iter().find(|(fits, _)| *fits).map(|(_, driver)| driver)
    }

    /// The tables before the process.
    fn head(&self, text: &mut Text, folder: &Path, driver: Driver) {
        text.comment("A first design, guessed by `fusion inspect` from the values of these files. Every guess says why.");
        text.comment("Check each against what you know of your instruments, above all noise, axes and lever arms.");
        text.table("run");
        let what = match driver {
            Driver::Odometer => "odometer, rate of turn and positions, in the plane",
            Driver::Inertial => "inertial unit and positions",
            Driver::Attitude => "dead reckoning by an attitude reference, with positions",
            Driver::Foot => "inertial unit on a foot, which stands at every stride",
            Driver::Gyros => "attitude by gyros and gravity",
        };
        text.quoted("description", &format!("first design: {what}"));
        text.quoted("data_dir", &self.data_dir(folder).display().to_string());
        self.origin(text);
        if driver == Driver::Odometer && self.has_recordings() {
            text.line("restart_after = \"5 s\"", RECORDINGS);
        }
        let is_fast = self.imu.as_ref().is_some_and(|(k, _)| self.logs[*k].rate() > 40.0);
        if is_fast {
            text.quoted("output_rate", "10 Hz");
        }
        text.table("filter");
        text.quoted("backend", "error_state");
        if driver == Driver::Inertial && self.told() == Told::Nobody {
            text.line(
                "bank = { hypotheses = 24, headings = 24, switch = 1 }",
                "guessed: no course, compass or magnetometer gives the heading; 24 are tried, and the best one stays",
            );
        } else if self.position.as_ref().is_some_and(|(_, track)| track.apart.is_some()) {
            let headings = if driver == Driver::Attitude { ", headings = 12" } else { "" };
            text.line(
                &format!("bank = {{ hypotheses = 24{headings} }}"),
                "guessed: of the two tracks of the positions each is tried",
            );
        }
    }

    /// Restarts a process with an input between recordings.
    fn apart(&self, text: &mut Text) {
        if self.has_recordings() {
            text.line("input.longest_gap = \"5 s\"", RECORDINGS);
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

    fn origin(&self, text: &mut Text) {
        let place = self
            .position
            .as_ref()
            .or(self.reference.as_ref())
            .and_then(|(_, track)| track.origin);
        match place {
            Some([lat, lon, height]) => text.line(
                &format!(
                    "origin = {{ latitude = \"{:.7} deg\", longitude = \"{:.7} deg\", height = \"{height:.1} m\" }}",
                    lat.to_degrees(),
                    lon.to_degrees()
                ),
                "the first position",
            ),
            None => text.line(
                "origin = { latitude = \"45 deg\", longitude = \"0 deg\", height = \"0 m\" }",
                "guessed: no file says where on Earth this is; gravity and the Earth's rotation follow from it",
            ),
        }
    }

    /// Whether the course can give the heading: the gyros turn as it does, and the velocity is reported.
    fn has_course(&self) -> bool {
        let is_fast = |track: &Track| track.is_reported && track.top_speed() > 3.0;
        self.position.as_ref().is_some_and(|(_, t)| is_fast(t)) && self.pair.is_some_and(|p| p.correlation.abs() > 0.8)
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
    fn judge(&self, text: &mut Text) {
        let is_used = |k: usize| [&self.position, &self.reference].into_iter().flatten().any(|(used, _)| *used == k);
        let estimates = (0..self.logs.len()).filter(|k| self.logs[*k].is_estimate() && !is_used(*k));
        let with_places = estimates.filter(|k| self.logs[*k].has(Geodetic) || self.logs[*k].has(Local));
        let names: Vec<String> = with_places.map(|k| format!("`{}`", self.logs[k].name())).collect();
        if !names.is_empty() {
            text.comment(&format!(
                "By name the estimate of another filter, no measurement: {}. To compare with one, declare it as a",
                names.join(", ")
            ));
            text.comment("`[source]` of its own and name that in `[reference]`: its errors are not independent of those of this filter.");
        }
        if let Some((k, track)) = &self.reference {
            text.section("judge");
            text.comment("guessed: this file looks like a ground truth, for it has an attitude or the smaller errors.");
            text.comment("It only scores the estimate; no filter can use it.");
            self.source(text, "reference", *k, &self.reference_kinds(*k), "");
            self.score(text, "reference", *k, track);
        } else if let Some((k, track)) = self.position.as_ref().filter(|(_, track)| track.rate() > WITHHELD) {
            text.section("judge");
            let every = track_stride(&self.logs[*k], track);
            text.comment("The fixes that the filter does not see. They are of the same receiver: an error that lasts longer than from one");
            text.comment("fix to the next is in both, so the true errors are larger than these, and a small NEES says nothing.");
            self.source(
                text,
                "withheld",
                *k,
                &self.reference_kinds(*k),
                &format!("keep = {{ except_every = {every} }}"),
            );
            self.score(text, "withheld", *k, track);
        } else if self.position.is_none() {
            self.judge_attitude(text);
        } else {
            text.section("judge");
            text.comment("No reference: nothing here looks like a ground truth. Judge the filter by the NIS of its sensors.");
        }
    }

    fn score(&self, text: &mut Text, source: &str, k: usize, track: &Track) {
        let log = &self.logs[k];
        text.table("reference");
        text.quoted("source", source);
        let mut sigma = Vec::new();
        let is_withheld = source == "withheld";
        if self.judges_with_reported(k) {
            sigma.push("position = { from_source = true }".to_owned());
        } else {
            let scatter = if is_withheld {
                self.white(log, track).0
            } else {
                track.scatter.max(1e-3)
            };
            sigma.push(format!("position = \"{:.3} m\"", (scatter * 1e3).ceil() * 1e-3));
        }
        let is_reported = log.has(super::Kind::VelocitySigma) && log.has(super::Kind::Velocity);
        let has_scatter = !is_reported && self.reference_kinds(k).contains(&super::Kind::Velocity) && track.velocity_scatter.is_finite();
        if is_reported {
            sigma.push("velocity = { from_source = true }".to_owned());
        } else if has_scatter {
            let scatter = track.velocity_scatter.max(1e-3);
            sigma.push(format!("velocity = \"{:.3} m/s\"", (scatter * 1e3).ceil() * 1e-3));
        }
        let why = match (self.judges_with_reported(k), is_withheld) {
            (true, _) => "as the file reports it",
            (false, true) => "that of the fixes which the filter uses",
            (false, false) => "the scatter of neighbouring positions",
        };
        let of_velocity = if has_scatter {
            "; of velocities the scatter of neighbouring ones"
        } else {
            ""
        };
        text.line(&format!("sigma = {{ {} }}", sigma.join(", ")), &format!("{why}{of_velocity}"));
        if self.reference_kinds(k).iter().any(|s| matches!(s, super::Kind::Quaternion | Euler)) {
            text.line(
                "remove_mean_mounting = true",
                "guessed: the unit is not mounted exactly as the reference",
            );
        }
    }
}

/// The row stride that makes one fix a second of a file.
fn track_stride(log: &Log, track: &Track) -> usize {
    // Rows that repeat the previous fix count as rows of the file, too.
    let rows = log.rate() / track.rate();
    (rows * track.rate()).round().max(2.0) as usize
}

/// Whether positions are local, not geodetic: from a room, a basin or USBL.
fn is_local(log: &Log) -> bool {
    log.has(Local) && !log.has(Geodetic)
}
