//! The embeddable filter: load, feed, read.

mod error;

pub use error::FeedError;

use crate::assembly::{Assembly, StreamLayout, assemble, declared_streams};
use crate::config::{Diagnostics, Document};
use crate::design::Design;
use crate::health::{Health, NamedReason, Names};
use crate::load::build;
use crate::observe::Filters;
use crate::rows::{Aboard, Carried, Pose};
use crate::solution::{Solution, SolutionReader};
use fusion_core::belief::Belief;
use fusion_core::checkpoint::{CheckpointError, Of, opened, sealed};
use fusion_core::memory::{self, Memory, Tape};
use fusion_core::runner::{Event, Observer, Row, RunError, StreamId};
use fusion_core::state::Layout;
use fusion_core::time::Time;
use fusion_models::plausible::Bounds;
use std::path::Path;

/// A navigation filter that a program feeds and reads.
///
/// ```
/// let design = r#"
/// [process]
/// type = "constant_velocity"
/// acceleration_noise = "0.5 m/s^2/sqrt(Hz)"
/// position_sigma = "10 m"
/// velocity_sigma = "5 m/s"
/// [run]
/// origin = { latitude = "47 deg", longitude = "8 deg" }
/// [sensor.gnss]
/// type = "gnss_position"
/// source = "gnss"
/// noise = { sigma = "2 m" }
/// [initial.fix]
/// type = "first_fix"
/// source = "gnss"
/// position_sigma = "5 m"
/// velocity_sigma = "1 m/s"
/// "#;
/// let mut nav = fusion::Navigator::from_toml(design)?;
/// # let (lat, lon) = (47f64.to_radians(), 8f64.to_radians());
/// nav.feed("gnss", 0.0, &[lat, lon, 400.0, 0.0, 0.0, 0.0])?;
/// nav.feed("gnss", 1.0, &[lat, lon, 400.0, 0.0, 0.0, 0.0])?;
/// assert!(nav.solution().is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Navigator {
    assembly: Assembly,
    reader: SolutionReader,
    /// Rows fed so far, per stream.
    counts: Vec<u64>,
    /// The possible numbers of the channels, per stream.
    bounds: Vec<Vec<Bounds>>,
    names: Names,
}

impl Navigator {
    /// From the file of a design, with the parts that it includes.
    ///
    /// ```
    /// let nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// assert_eq!(nav.layout().dim(), 15);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Every mistake, each with its place.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, Diagnostics> {
        Self::from_document(Document::load(path.as_ref())?)
    }

    /// From the text of a design that includes nothing.
    ///
    /// ```
    /// let text = std::fs::read_to_string("../examples/embed.toml")?;
    /// assert!(fusion::Navigator::from_toml(&text).is_ok());
    ///
    /// // Each mistake is told with its place and what to do.
    /// let told = fusion::Navigator::from_toml(&text.replace("lever_arm", "lever_rm")).unwrap_err().to_string();
    /// assert!(told.contains("did you mean `lever_arm`?"), "{told}");
    /// # Ok::<(), std::io::Error>(())
    /// ```
    ///
    /// # Errors
    /// Every mistake in the text, each with its place.
    pub fn from_toml(text: &str) -> Result<Self, Diagnostics> {
        Self::named("design.toml", text)
    }

    /// From the text of a design; the paths of what it includes start at `folder`.
    ///
    /// ```
    /// let design = "include = ['embed.toml']\nsensor.position.lever_arm = [0, 0, 0]";
    /// let nav = fusion::Navigator::from_toml_in("../examples", design)?;
    /// assert_eq!(nav.streams().len(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Every mistake, each with its place.
    pub fn from_toml_in(folder: impl AsRef<Path>, text: &str) -> Result<Self, Diagnostics> {
        Self::from_document(Document::read_in(folder.as_ref(), text)?)
    }

    /// From the text of a design, which diagnostics call `name`; it includes nothing.
    ///
    /// # Errors
    /// Every mistake in the text, each with its place.
    pub fn named(name: &str, text: &str) -> Result<Self, Diagnostics> {
        let (document, mistakes) = Document::parse(name, text);
        let mut d = Diagnostics::new();
        d.extend(mistakes);
        Self::from_document(d.unless_errors(document)?)
    }

    fn from_document(document: Document) -> Result<Self, Diagnostics> {
        Self::of(&build(document)?)
    }

    /// From a design, such as one of a [`Selection`](crate::Selection).
    ///
    /// # Errors
    /// The mistakes of assembling it.
    pub fn of(design: &Design) -> Result<Self, Diagnostics> {
        let streams = declared_streams(design)?;
        Ok(Self::from_assembly(assemble(design, streams)?))
    }

    /// From a design that has been assembled.
    #[must_use]
    pub fn from_assembly(assembly: Assembly) -> Self {
        let reader = SolutionReader::new(&assembly.layout, assembly.process.clone());
        let counts = vec![0; assembly.streams.len()];
        let bounds = assembly.streams.iter().map(StreamLayout::bounds).collect();
        let filters = Filters::of(&assembly);
        let names = filters.outermost().map(|own| Names::new(own, &assembly)).unwrap_or_default();
        Self {
            assembly,
            reader,
            counts,
            bounds,
            names,
        }
    }

    /// The number of a stream, for [`Navigator::feed_stream`].
    ///
    /// ```
    /// # let nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let imu = nav.stream("imu")?;
    /// assert_eq!(nav.streams()[imu].name, "imu");
    /// assert!(nav.stream("lidar").unwrap_err().to_string().contains("`gnss`"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`FeedError::UnknownStream`].
    pub fn stream(&self, name: &str) -> Result<StreamId, FeedError> {
        self.assembly.runner.stream(name).ok_or_else(|| FeedError::UnknownStream {
            name: name.to_owned(),
            known: self
                .assembly
                .streams
                .iter()
                .map(|s| format!("`{}`", s.name))
                .collect::<Vec<_>>()
                .join(", "),
        })
    }

    /// The streams with their channels: the layout of their rows.
    ///
    /// ```
    /// # let nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let imu = &nav.streams()[nav.stream("imu")?];
    /// let channels: Vec<_> = imu.channels.iter().map(|c| (c.name.as_str(), c.offset, c.width)).collect();
    /// assert_eq!(channels, [("angular_rate", 0, 3), ("specific_force", 3, 3)]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn streams(&self) -> &[StreamLayout] {
        &self.assembly.streams
    }

    /// Feeds a row stamped `seconds`; its numbers are those of [`Navigator::streams`], in SI, angles
    /// in radians. Impossible values are refused: a latitude beyond a pole, a speed beyond that of light,
    /// a stamp that is not finite.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// nav.feed("gnss", 0.0, &[0.63, 2.26, 50.0])?;
    /// let told = nav.feed("gnss", 1.0, &[36.1, 129.5, 50.0]).unwrap_err().to_string();
    /// assert!(told.contains("angles are in radians"), "{told}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`FeedError`]; the filter is unchanged.
    pub fn feed(&mut self, stream: &str, seconds: f64, row: &[f64]) -> Result<(), FeedError> {
        let id = self.stream(stream)?;
        self.feed_stream(id, stamp(stream, seconds)?, row, &mut |_: &Event<'_>| {})
    }

    /// Feeds a row as [`Navigator::feed`] does, with the time of its arrival \[s\], by a monotonic clock of any origin.
    /// The first row after a gap is then used at once if as much time has passed. Without an arrival, 20 rows wait
    /// until the 21st confirms that the stamps have not jumped.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let clock = std::time::Instant::now();
    /// nav.feed_arrived("gnss", 0.0, clock.elapsed().as_secs_f64(), &[0.63, 2.26, 50.0])?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`FeedError`]; the filter is unchanged.
    pub fn feed_arrived(&mut self, stream: &str, seconds: f64, arrival: f64, row: &[f64]) -> Result<(), FeedError> {
        let id = self.stream(stream)?;
        let row = Row {
            arrival: Some(stamp(stream, arrival)?),
            ..Row::new(id, stamp(stream, seconds)?, row)
        };
        self.feed_next(row, &mut |_: &Event<'_>| {})
    }

    /// Feeds a row, and passes the events that it causes to `observer`; rows of a stream are numbered from 0.
    ///
    /// ```
    /// use fusion::core::{Time, runner::Event};
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let imu = nav.stream("imu")?;
    /// let mut started = None;
    /// for k in 0..=1100 {
    ///     let time = Time::from_nanos(k * 10_000_000);
    ///     if k % 100 == 0 {
    ///         nav.feed("gnss", time.seconds(), &[0.63, 2.26, 50.0])?;
    ///     }
    ///     nav.feed_stream(imu, time, &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8], &mut |event: &Event<'_>| {
    ///         if let Event::Started { belief, .. } = event {
    ///             started = Some(belief.time.seconds());
    ///         }
    ///     })?;
    /// }
    /// // The design levels over ten seconds at rest.
    /// assert!(started.is_some_and(|seconds| seconds >= 10.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`FeedError`]; a refused row leaves the filter unchanged.
    pub fn feed_stream(&mut self, stream: StreamId, time: Time, row: &[f64], observer: &mut dyn Observer) -> Result<(), FeedError> {
        self.feed_next(Row::new(stream, time, row), observer)
    }

    /// Numbers a row and feeds it.
    fn feed_next(&mut self, mut row: Row<'_>, observer: &mut dyn Observer) -> Result<(), FeedError> {
        row.number = self.counts.get(row.stream).copied().unwrap_or_default();
        self.feed_row(&row, observer)?;
        self.counts[row.stream] += 1;
        Ok(())
    }

    /// Feeds a row that has its own number, and passes the events that it causes to `observer`.
    ///
    /// # Errors
    /// [`FeedError`]; a refused row leaves the filter unchanged.
    pub fn feed_row(&mut self, row: &Row<'_>, observer: &mut dyn Observer) -> Result<(), FeedError> {
        self.check(row)?;
        self.assembly.runner.feed(row, observer).map_err(|error| {
            let error = match error {
                RunError::Width(error) => error,
                RunError::Observer(halt) => return FeedError::Observer(halt),
            };
            let layout = self.assembly.streams.get(row.stream);
            let channels = layout.map_or(&[][..], |l| &l.channels).iter();
            FeedError::Width {
                stream: layout.map(|l| l.name.clone()).unwrap_or_default(),
                error,
                channels: channels.map(|c| format!("{} × {}", c.width, c.name)).collect::<Vec<_>>().join(", "),
            }
        })
    }

    /// Refuses values that are physically impossible. A sensor that reads a number that is not finite reports
    /// it by an event.
    fn check(&self, row: &Row<'_>) -> Result<(), FeedError> {
        let Some(layout) = self.assembly.streams.get(row.stream) else {
            return Ok(());
        };
        // A row of another width is refused by the runner.
        let mut checked = self.bounds[row.stream].iter().zip(&layout.channels);
        checked.try_for_each(|(bounds, channel)| {
            bounds.check(row.values).map_err(|error| FeedError::Impossible {
                stream: layout.name.clone(),
                channel: channel.name.clone(),
                error,
            })
        })
    }

    /// Processes what has been held back: the end of the data.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// use fusion::core::runner::Event;
    /// let mut last = 0.0;
    /// nav.finish(&mut |event: &Event<'_>| {
    ///     if let Event::Estimate { belief } = event {
    ///         last = belief.time.seconds();
    ///     }
    /// })?;
    /// assert_eq!(last, 11.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`FeedError::Observer`].
    pub fn finish(&mut self, observer: &mut dyn Observer) -> Result<(), FeedError> {
        self.assembly.runner.finish(observer).map_err(FeedError::Observer)
    }

    /// Position, velocity and attitude; `None` until the filter has started.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// let solution = nav.solution().ok_or("it has not started")?;
    /// let (rpy, sigma) = solution.rpy().ok_or("it has no attitude")?;
    /// // As the design says at its start: 30 deg, 1σ 2 deg.
    /// assert!((rpy.z.to_degrees() - 30.0).abs() < 0.1 && (sigma.z.to_degrees() - 2.0).abs() < 0.1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solution(&mut self) -> Option<Solution> {
        self.belief()?;
        Some(*self.reader.read(self.assembly.runner.belief()))
    }

    /// The solution at `seconds` if no row comes until then. Rows that are still held back are used, and
    /// the rest of the time is predicted. Without input, the prediction uses the vehicle's agility, so that
    /// σ grows. `None` until the filter has started, and if it would have stopped by then. The filter itself
    /// does not change. For a time before that of [`Navigator::solution`], it returns that solution.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// let (_, now) = nav.predict(11.0).and_then(|s| s.position).ok_or("it has not started")?;
    /// let (_, later) = nav.predict(14.0).and_then(|s| s.position).ok_or("it would have stopped")?;
    /// // No row comes, so the 1σ grows. Variances north, east, down [m²].
    /// assert!(later.m11 > now.m11);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn predict(&mut self, seconds: f64) -> Option<Solution> {
        let belief = self.assembly.runner.predicted(Time::from_seconds(seconds))?;
        Some(*self.reader.read(&belief))
    }

    /// The whole memory of the filter, with the rows that it holds back. If it goes back for late rows, the
    /// snapshots are included. Another navigator of the same design that is [restored](Self::restore) from it
    /// continues exactly, bit for bit, as this navigator would.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// let saved = nav.checkpoint();
    ///
    /// // In another process:
    /// let mut again = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// again.restore(&saved)?;
    /// for nav in [&mut nav, &mut again] {
    ///     nav.feed("imu", 11.01, &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// }
    /// assert_eq!(nav.belief().map(|b| &b.x), again.belief().map(|b| &b.x));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn checkpoint(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        memory::save(self, &mut bytes);
        sealed(Of::Navigator, self.assembly.fingerprint, &bytes)
    }

    /// Resumes from a checkpoint.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let mut saved = nav.checkpoint();
    /// assert!(nav.restore(&saved).is_ok());
    /// saved.pop();
    /// assert!(nav.restore(&saved).is_err(), "it is not whole");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`CheckpointError`] if the bytes are incomplete, or belong to another design or version; the navigator is
    /// unchanged.
    pub fn restore(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        let bytes = opened(Of::Navigator, self.assembly.fingerprint, checkpoint)?;
        memory::restore(self, bytes).map_err(|_| CheckpointError::Damaged)
    }

    /// The whole belief: state and covariance; `None` until the filter has started.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// let belief = nav.belief().ok_or("it has not started")?;
    /// let bias = nav.layout().block("gyro_bias").ok_or("it is no state")?;
    /// let value = &belief.x[bias.storage_range()];
    /// let sigma: Vec<f64> = belief.covariance.sigmas(bias).collect();
    /// assert_eq!((value.len(), sigma.len()), (3, 3));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn belief(&self) -> Option<&Belief> {
        self.assembly.runner.started().then(|| self.assembly.runner.belief())
    }

    /// The health of the filter: how reliable its estimate is. The observer of [`Navigator::feed_stream`] receives
    /// the changes, also for filters inside stages.
    ///
    /// ```
    /// use fusion::core::health::State;
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// assert_eq!(nav.health().state, State::Aligning);
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// assert_eq!(nav.health().state, State::Good);
    /// assert!(nav.health_reasons().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn health(&self) -> &Health {
        self.assembly.runner.health()
    }

    /// The reasons for the health, in the names of the design.
    ///
    /// ```
    /// # let mut nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// # for k in 0..=1100 {
    /// #     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    /// #     if k % 100 == 0 {
    /// #         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    /// #     }
    /// # }
    /// // A fix every second, and none from 20 s on.
    /// for k in 1101..=6000 {
    ///     nav.feed("imu", 0.01 * f64::from(k), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8])?;
    ///     if k % 100 == 0 && k < 2000 {
    ///         nav.feed("gnss", 0.01 * f64::from(k), &[0.63, 2.26, 50.0])?;
    ///     }
    /// }
    /// let reasons: Vec<String> = nav.health_reasons().iter().map(ToString::to_string).collect();
    /// assert_eq!(reasons, ["nothing measures position or velocity", "`position` silent"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn health_reasons(&self) -> Vec<NamedReason> {
        self.health().reasons.iter().map(|r| self.names.of(*r)).collect()
    }

    /// The conditions that the filter still waits for before it can start: initialiser and reason.
    ///
    /// ```
    /// # let nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let waiting: Vec<_> = nav.waits_for().into_iter().map(|(initialiser, _)| initialiser).collect();
    /// assert_eq!(waiting, ["initial.level", "initial.fix"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn waits_for(&self) -> Vec<(String, String)> {
        if self.assembly.runner.started() {
            Vec::new()
        } else {
            self.assembly.runner.waits_for()
        }
    }

    /// The layout of the state.
    ///
    /// ```
    /// # let nav = fusion::Navigator::from_file("../examples/embed.toml")?;
    /// let names: Vec<_> = nav.layout().blocks().iter().map(|block| block.name.as_str()).collect();
    /// assert_eq!(names, ["position", "velocity", "attitude", "gyro_bias", "accel_bias"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.assembly.layout
    }

    /// The parts.
    #[must_use]
    pub const fn assembly(&self) -> &Assembly {
        &self.assembly
    }
}

/// The time of a row of this stream, from seconds.
fn stamp(stream: &str, seconds: f64) -> Result<Time, FeedError> {
    Time::checked_from_seconds(seconds).ok_or_else(|| FeedError::Stamp {
        stream: stream.to_owned(),
        seconds,
    })
}

/// Carried by a vehicle of a simulated world, which it steers.
impl Aboard for Navigator {
    fn pose(&mut self, now: Time) -> Option<Pose> {
        let (runner, reader) = (&mut self.assembly.runner, &mut self.reader);
        Carried {
            runner,
            reader,
            said: None,
        }
        .pose(now)
    }
}

impl Memory for Navigator {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.counts.as_mut_slice().remember(tape);
        self.assembly.runner.remember(tape);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::health::State;

    #[test]
    fn a_program_hears_of_the_health_and_reads_it_with_names() {
        let mut nav = Navigator::from_toml(
            "[process]
            type = 'constant_velocity'
            acceleration_noise = 0.1
            position_sigma = 10
            velocity_sigma = 5
            [run]
            origin = { latitude = 0.8, longitude = 0.1 }
            [sensor.fix]
            type = 'gnss_position'
            source = 'gnss'
            noise = { sigma = 2 }
            gate = { type = 'nis', probability = 0.99 }
            [initial.start]
            type = 'first_fix'
            source = 'gnss'
            position_sigma = 5
            velocity_sigma = 1",
        )
        .unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(nav.health().state, State::Aligning);
        let gnss = nav.stream("gnss").unwrap();
        let width = nav.streams()[gnss].width();
        let mut heard = Vec::new();
        for k in 0..20 {
            let mut row = [0.8, 0.1, 0.0, 0.0, 0.0, 0.0];
            // Ten fixes at a distance of 6 km.
            row[0] += if k < 10 { 0.0 } else { 1e-3 };
            let mut listen = |event: &Event<'_>| {
                if let Event::Health { health } = event {
                    heard.push(health.state);
                }
            };
            nav.feed_stream(gnss, Time::from_seconds(f64::from(k)), &row[..width], &mut listen)
                .unwrap();
        }
        assert_eq!(heard, [State::Good, State::Degraded]);
        assert_eq!(nav.health().state, State::Degraded);
        let reasons: Vec<String> = nav.health_reasons().iter().map(ToString::to_string).collect();
        assert_eq!(reasons, ["`fix` rejected"]);
    }

    #[test]
    fn a_reported_sigma_of_an_attitude_has_a_number_per_axis() {
        let mut nav = Navigator::from_toml(
            "[process]
            type = 'attitude_only'
            source = 'imu'
            gyro_noise = 0
            [sensor.mocap]
            type = 'attitude'
            source = 'mocap'
            noise = { from_source = true, scale = 2 }
            [initial.start]
            type = 'explicit'
            attitude = [0, 0, 0]
            attitude_sigma = 0.04",
        )
        .unwrap_or_else(|d| panic!("{d}"));
        let mocap = nav
            .streams()
            .iter()
            .find(|s| s.name == "mocap")
            .map(|s| s.channels.clone())
            .unwrap_or_default();
        let widths: Vec<_> = mocap.iter().map(|c| (c.name.as_str(), c.offset, c.width)).collect();
        assert_eq!(widths, [("attitude", 0, 4), ("attitude_sigma", 4, 3)]);
        nav.feed("imu", 0.0, &[0.0; 3]).unwrap();
        nav.feed("imu", 1.0, &[0.0; 3]).unwrap();
        nav.feed("mocap", 1.0, &[1.0, 0.0, 0.0, 0.0, 0.01, 0.015, 0.02]).unwrap();
        nav.finish(&mut |_: &Event<'_>| {}).unwrap();
        let belief = nav.belief().unwrap();
        let found: Vec<f64> = belief.covariance.sigmas(&nav.layout().blocks()[0]).collect();
        for (i, reported) in [0.02, 0.03, 0.04].into_iter().enumerate() {
            let expected = f64::hypot(1.0 / 0.04, 1.0 / reported).recip();
            // 1e-12: rounding; nothing turns, so the axes stay apart.
            let sigma = found[i];
            assert!((sigma - expected).abs() < 1e-12, "axis {i}: {sigma} for {expected}");
        }
    }

    const DESIGN: &str = "
        [process]
        type = 'constant_velocity'
        acceleration_noise = 1
        position_sigma = 10
        velocity_sigma = 5
        [run]
        origin = { latitude = 0.8, longitude = 0.1 }
        [sensor.gnss]
        type = 'gnss_position'
        source = 'gnss'
        noise = { from_source = true }
        [sensor.speed]
        type = 'gnss_velocity'
        source = 'gnss'
        noise = { sigma = 0.1 }
        [initial.fix]
        type = 'first_fix'
        source = 'gnss'
        position_sigma = 5
        velocity_sigma = 1";

    #[test]
    fn a_stamp_that_is_no_time_is_refused() {
        let mut nav = Navigator::from_toml(DESIGN).unwrap_or_else(|d| panic!("{d}"));
        let row = [0.8, 0.1, 400.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0];
        for seconds in [f64::NAN, f64::INFINITY, -1e300, 9.3e9] {
            let told = nav.feed("gnss", seconds, &row).unwrap_err().to_string();
            assert!(told.starts_with(&format!("stream `gnss`: {seconds} s is not a stamp")), "{told}");
        }
        assert!(nav.solution().is_none(), "a NaN was the time 0");
        nav.feed("gnss", 1.0, &row).unwrap();
        nav.finish(&mut |_: &Event<'_>| {}).unwrap();
        assert_eq!(nav.solution().unwrap().time, Time::from_seconds(1.0));
    }

    #[test]
    fn after_a_gap_that_the_clock_of_arrival_confirms_the_first_row_is_used() {
        let row = [0.8, 0.1, 400.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0];
        let after_an_hour = |passed: f64| {
            let mut nav = Navigator::from_toml(DESIGN).unwrap_or_else(|d| panic!("{d}"));
            for (time, arrival) in [(0.0, 70.0), (1.0, 71.0), (3600.0, 71.0 + passed)] {
                nav.feed_arrived("gnss", time, arrival, &row).unwrap();
            }
            nav.finish(&mut |_: &Event<'_>| {}).unwrap();
            nav.solution().unwrap().time.seconds()
        };
        assert_eq!(after_an_hour(3599.0), 3600.0);
        // The stamp is wrong: its row waits for other rows, but none come.
        assert_eq!(after_an_hour(1.0), 1.0);
    }

    #[test]
    fn what_cannot_have_been_measured_is_refused_as_in_a_file() {
        let mut nav = Navigator::from_toml(DESIGN).unwrap_or_else(|d| panic!("{d}"));
        let names: Vec<_> = nav.streams()[0].channels.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["position", "position_sigma", "velocity"]);
        let row = [0.8, 0.1, 400.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0];
        let mut told = |column: usize, value: f64| {
            let mut row = row;
            row[column] = value;
            nav.feed("gnss", 0.0, &row).err().map(|e| e.to_string())
        };
        let position = "stream `gnss`, channel `position`: ";
        assert_eq!(
            told(0, 45.0).unwrap(),
            format!("{position}the latitude 45 rad lies beyond a pole; angles are in radians")
        );
        assert!(told(1, 8.0).unwrap().starts_with(position));
        assert!(told(2, 1e38).unwrap().starts_with(position));
        assert_eq!(
            told(4, 0.0).unwrap(),
            "stream `gnss`, channel `position_sigma`: a 1σ is above zero, not 0"
        );
        assert!(told(8, 1e38).unwrap().contains("channel `velocity`: 1e38 cannot be"));
        // The sensor that reads it reports it by an event; another sensor can use the row.
        assert_eq!(told(8, f64::NAN), None);
        assert_eq!(told(8, 0.0), None);
    }
}
