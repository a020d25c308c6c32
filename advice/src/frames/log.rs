//! The recorded motion channels of a design, decimated while they are read.

use super::regression::{Fits, Pairs, fits};
use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::rows::RowStream;
use fusion::run::{Options, data_dir, open_one};
use fusion::source::OpenContext;
use fusion_core::time::Time;
use fusion_models::block::Channel;
use fusion_models::units::{Dimensional, dim};
use fusion_models::vocabulary::channel;
use nalgebra::Vector3;

/// The least spacing of the samples of positions, velocities and attitudes \[s\]. Below it the slope of a position is
/// mostly noise.
const APART: f64 = 0.5;
/// The spacing of the stored integrals of rates, forces and fields \[s\], with interpolation in between.
const GRID: f64 = 0.1;
/// A longer gap has no mean \[s\].
const LONGEST: f64 = 1.0;

/// The channels to compare. The first three are compared as means over intervals, the others as values.
pub(super) const COMPARED: [Channel; 8] = [
    channel::ANGULAR_RATE,
    channel::SPECIFIC_FORCE,
    channel::MAGNETIC_FIELD,
    channel::POSITION,
    channel::VELOCITY,
    channel::ATTITUDE,
    channel::HEADING,
    Channel::vector("pressure", 1, dim::Pressure::KIND.dimension),
];

/// The expected mean from one time to another, for each axis; NaN if unknown.
pub(super) type Told = (f64, f64, Vector3<f64>);

/// A channel of a source over time.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// The index of its source in the design.
    pub(super) source: usize,
    /// Its name.
    pub(super) channel: &'static str,
    /// The time of each kept sample \[s\].
    pub(super) times: Vec<f64>,
    /// The values. For rates, forces and fields, the integral up to this time; the fourth value is the integral of
    /// their length. Unused values are zero.
    pub(super) values: Vec<[f64; 4]>,
    /// Rows per second.
    pub(super) rate: f64,
    pub(super) integrates: bool,
    /// The integral of a decimated velocity over all samples. So samples between the kept ones count in its means.
    pub(super) way: Vec<(f64, Vector3<f64>)>,
}

impl Track {
    /// The mean over an interval; `None` if the log does not cover it.
    pub(super) fn mean(&self, from: f64, to: f64) -> Option<Vector3<f64>> {
        let (a, b) = (self.integral(from)?, self.integral(to)?);
        let first = self.times.partition_point(|t| *t <= from);
        let last = self.times.partition_point(|t| *t < to).min(self.times.len() - 1);
        let steps = self.times[first.saturating_sub(1)..=last].windows(2);
        let is_whole = steps.into_iter().all(|w| w[1] - w[0] <= LONGEST);
        (is_whole && to > from).then(|| (b - a) / (to - from))
    }

    /// The mean length over an interval; `None` if the log does not cover it.
    pub(super) fn mean_length(&self, from: f64, to: f64) -> Option<f64> {
        let at = |time: f64| {
            let next = self.times.partition_point(|t| *t < time);
            let before = next.checked_sub(1)?;
            let (after, length) = (*self.times.get(next)?, |i: usize| self.values[i][3]);
            let share = (time - self.times[before]) / (after - self.times[before]);
            Some(length(before) + share * (length(next) - length(before)))
        };
        Some((at(to)? - at(from)?) / (to - from))
    }

    /// The expected values, with the means of the values measured `lag` earlier.
    pub(super) fn pairs(&self, told: &[Told], lag: f64) -> Pairs {
        let measured = told
            .iter()
            .filter_map(|(from, to, expected)| Some((*expected, self.mean(from - lag, to - lag)?)));
        measured.collect()
    }

    /// How its axes explain the expected values.
    pub(super) fn fits(&self, told: &[Told], lag: f64) -> Fits {
        fits(&self.pairs(told, lag))
    }

    /// Returns true for a track of the same channel.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.source == other.source && self.channel == other.channel
    }

    fn integral(&self, at: f64) -> Option<Vector3<f64>> {
        let next = self.times.partition_point(|t| *t < at);
        let vector = |i: usize| Vector3::new(self.values[i][0], self.values[i][1], self.values[i][2]);
        match next {
            0 => (*self.times.first()? == at).then(|| vector(0)),
            n if n == self.times.len() => None,
            n => {
                let share = (at - self.times[n - 1]) / (self.times[n] - self.times[n - 1]);
                Some(vector(n - 1).lerp(&vector(n), share))
            }
        }
    }
}

/// Collects the rows of one channel.
struct Keeper {
    track: Track,
    offset: usize,
    width: usize,
    delay: f64,
    sum: [f64; 4],
    before: Option<Vector3<f64>>,
    last: f64,
    first: f64,
    count: f64,
}

impl Keeper {
    fn take(&mut self, time: Time, row: &[f64]) {
        let (t, values) = (time.seconds() - self.delay, &row[self.offset..self.offset + self.width]);
        // A row that goes back in time or contains NaN is skipped here; the run reports it.
        if values.iter().any(|v| !v.is_finite()) || t <= self.last {
            return;
        }
        let step = t - self.last;
        let mut kept = [0.0; 4];
        kept[..self.width].copy_from_slice(values);
        if self.track.integrates {
            let covered = if step <= LONGEST { step } else { 0.0 };
            kept[3] = Vector3::new(kept[0], kept[1], kept[2]).norm();
            self.sum.iter_mut().zip(kept).for_each(|(sum, v)| *sum += v * covered);
            kept = self.sum;
        }
        if self.track.channel == "velocity" {
            self.travel(t, step, Vector3::new(kept[0], kept[1], kept[2]));
        }
        self.first = self.first.min(t);
        self.count += 1.0;
        self.last = t;
        let apart = if self.track.integrates { GRID } else { APART };
        // 1 ms: stamps of an even rate jitter by rounding.
        if self.track.times.last().is_none_or(|last| t - last >= apart - 1e-3) {
            self.track.times.push(t);
            self.track.values.push(kept);
        }
    }

    /// Adds the distance since the last velocity.
    fn travel(&mut self, t: f64, step: f64, v: Vector3<f64>) {
        let way = self.before.map_or_else(Vector3::zeros, |before| (before + v) * (step / 2.0));
        self.before = Some(v);
        (0..3).for_each(|i| self.sum[i] += way[i]);
        if self.track.way.last().is_none_or(|(last, _)| t - last >= GRID - 1e-3) {
            self.track.way.push((t, Vector3::new(self.sum[0], self.sum[1], self.sum[2])));
        }
    }

    fn finish(mut self) -> Track {
        self.track.rate = (self.count - 1.0).max(0.0) / (self.last - self.first).max(GRID);
        // If all samples are kept, the sum between them is not needed.
        if self.count as usize == self.track.times.len() {
            self.track.way.clear();
        }
        self.track
    }
}

/// Reads the sources of a design, as it decodes them, over its run time.
pub(super) fn read(design: &Design, options: &Options) -> Result<Vec<Track>, Diagnostics> {
    let (mut d, mut tracks) = (Diagnostics::new(), Vec::new());
    for number in 0..design.sources.len() {
        match read_source(design, options, number) {
            Ok(read) => tracks.extend(read),
            Err(found) => d.extend(found.iter().cloned()),
        }
    }
    d.unless_errors(tracks)
}

/// Reads one source of a design.
pub(super) fn read_source(design: &Design, options: &Options, number: usize) -> Result<Vec<Track>, Diagnostics> {
    let named = &design.sources[number];
    let context = OpenContext {
        data_dir: data_dir(design, options),
        name: named.name.clone(),
        origin: design.run.origin.map(Into::into),
        seed: options.seed.unwrap_or(design.run.seed),
        ..OpenContext::default()
    };
    let wrong = |error: fusion::rows::SourceError| {
        let mut d = Diagnostics::new();
        d.extend(error.diagnostics(&named.node));
        d
    };
    let mut rows = open_one(&named.block, &context).map_err(wrong)?;
    let mut keepers = keepers(number, rows.as_ref());
    feed(design, rows.as_mut(), &mut keepers).map_err(wrong)?;
    Ok(keepers.into_iter().map(Keeper::finish).filter(|t| !t.times.is_empty()).collect())
}

fn keepers(source: usize, rows: &dyn RowStream) -> Vec<Keeper> {
    let wanted = |name: &str| COMPARED.iter().position(|c| c.name == name);
    let compared = rows.channels().iter().filter_map(|p| {
        let number = wanted(&p.channel.name)?;
        let is_so = COMPARED[number].width == p.channel.width && COMPARED[number].shape == p.channel.shape;
        is_so.then_some((number, p))
    });
    let keeper = |(number, p): (usize, &fusion::rows::ProvidedChannel)| Keeper {
        track: Track {
            source,
            channel: NAMES[number],
            times: Vec::new(),
            values: Vec::new(),
            rate: 0.0,
            integrates: number < 3,
            way: Vec::new(),
        },
        offset: p.offset,
        width: p.channel.width,
        delay: p.delay_ns as f64 * 1e-9,
        sum: [0.0; 4],
        before: None,
        last: f64::NEG_INFINITY,
        first: f64::INFINITY,
        count: 0.0,
    };
    compared.map(keeper).collect()
}

/// The names of [`COMPARED`].
pub(super) const NAMES: [&str; 8] = [
    "angular_rate",
    "specific_force",
    "magnetic_field",
    "position",
    "velocity",
    "attitude",
    "heading",
    "pressure",
];

fn feed(design: &Design, rows: &mut dyn RowStream, keepers: &mut [Keeper]) -> Result<(), fusion::rows::SourceError> {
    if keepers.is_empty() {
        return Ok(());
    }
    let start = design.run.start.map_or(Time::MIN, |t| Time::from_seconds(t.si()));
    let stop = design.run.stop.map_or(Time::MAX, |t| Time::from_seconds(t.si()));
    let mut values = Vec::new();
    while let Some(stamp) = rows.next(&mut values)? {
        if stamp.time >= start && stamp.time <= stop {
            keepers.iter_mut().for_each(|k| k.take(stamp.time, &values));
        }
    }
    Ok(())
}
