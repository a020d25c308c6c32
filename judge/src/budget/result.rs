//! The result: for each axis of the state, the variance that each source brings.

use core::fmt::Write as _;
use fusion::provenance::Provenance;
use fusion_core::math;

/// The error budget of a design.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Budget {
    /// The description of the design.
    pub description: String,
    /// Design, program, and seed of the nominal run.
    pub provenance: Provenance,
    /// The sources of errors, in the order of the variances.
    pub sources: Vec<String>,
    /// The axes of the state, in the order of the layout.
    pub states: Vec<StateBudget>,
    /// The shares over time, for a picture.
    pub course: Course,
    /// The measurements of the nominal run, by sensor.
    pub rows: Vec<SensorRows>,
    /// The errors of the world that the budget does not cover.
    pub outside: Vec<String>,
}

/// The budget of one axis of the state.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StateBudget {
    /// The block of the state.
    pub state: String,
    /// Its axis; empty for a block of one axis. An attitude has roll, pitch and yaw.
    pub axis: String,
    /// The SI unit of the axis.
    pub unit: &'static str,
    /// At the last tenth of a second of the run.
    pub end: Split,
    /// The mean of the variances over the run, from `[reference] from` on.
    pub rms: Split,
    /// At the times that were asked for.
    pub at: Vec<Split>,
}

impl StateBudget {
    /// Block and axis.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} {}", self.state, self.axis).trim_end().to_owned()
    }
}

/// The variance of an error, split by source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// When \[s\]; without meaning for a mean.
    pub time: f64,
    /// The variance from each source, in the squared unit of the axis.
    pub variances: Vec<f64>,
    /// The variance that the filter itself reports.
    pub filter: f64,
}

impl Split {
    /// The variance of the error: the sum over the sources.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.variances.iter().sum()
    }

    /// 1σ of the error.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        math::sqrt(self.total())
    }

    /// 1σ of the part from one source.
    #[must_use]
    pub fn sigma_of(&self, source: usize) -> f64 {
        math::sqrt(self.variances[source].max(0.0))
    }

    /// The share of the variance from one source, where 1 is the whole; NaN without any error.
    #[must_use]
    pub fn share(&self, source: usize) -> f64 {
        self.variances[source] / self.total()
    }

    /// 1σ of the error if a source were half as large, with the same gains.
    #[must_use]
    pub fn halved(&self, source: usize) -> f64 {
        math::sqrt((self.total() - 0.75 * self.variances[source]).max(0.0))
    }

    /// The source whose halving makes the error smallest; `None` without any error.
    #[must_use]
    pub fn largest(&self) -> Option<usize> {
        let all = self.variances.iter().enumerate();
        all.max_by(|a, b| a.1.total_cmp(b.1))
            .filter(|(_, v)| **v > 0.0)
            .map(|(source, _)| source)
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.variances.resize(other.variances.len(), 0.0);
        self.variances.iter_mut().zip(&other.variances).for_each(|(own, v)| *own += v);
        self.filter += other.filter;
    }

    pub(super) fn over(mut self, count: f64) -> Self {
        self.variances.iter_mut().for_each(|v| *v /= count);
        self.filter /= count;
        self
    }

    fn keep(&mut self, kept: &[bool]) {
        let mut is_kept = kept.iter();
        self.variances.retain(|_| is_kept.next().copied().unwrap_or(true));
    }
}

/// The measurements of a sensor in the nominal run.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SensorRows {
    /// The sensor.
    pub name: String,
    /// Measurements that corrected the estimate.
    pub used: u64,
    /// Measurements that a gate rejected, or that could not be used: their gain is 0.
    pub rejected: u64,
}

impl SensorRows {
    pub(super) fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            used: 0,
            rejected: 0,
        }
    }
}

/// The variances of all axes over time, thinned for a picture.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// One time of this number is kept.
    every: usize,
    passed: usize,
    points: Vec<(f64, Vec<Split>)>,
}

/// The most times that a course keeps: two per pixel column of a small plot are not seen.
const MOST_POINTS: usize = 512;

impl Course {
    pub(super) fn push<'s>(&mut self, time: f64, states: impl Iterator<Item = &'s Split>) {
        self.every = self.every.max(1);
        self.passed += 1;
        if !(self.passed - 1).is_multiple_of(self.every) {
            return;
        }
        if self.points.len() == MOST_POINTS {
            let mut is_kept = false;
            self.points.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.every *= 2;
        }
        self.points.push((time, states.cloned().collect()));
    }

    /// The times \[s\], each with the split of every axis.
    #[must_use]
    pub fn points(&self) -> &[(f64, Vec<Split>)] {
        &self.points
    }
}

impl Budget {
    /// Leaves out the sources that bring no error into any axis.
    pub(super) fn without_idle_sources(mut self) -> Self {
        let is_active = |source: usize| {
            let splits = self.states.iter().flat_map(|s| [&s.end, &s.rms]);
            splits.into_iter().any(|split| split.variances[source] > 0.0)
        };
        let kept: Vec<bool> = (0..self.sources.len()).map(is_active).collect();
        let mut is_kept = kept.iter();
        self.sources.retain(|_| is_kept.next().copied().unwrap_or(true));
        for state in &mut self.states {
            state
                .at
                .iter_mut()
                .chain([&mut state.end, &mut state.rms])
                .for_each(|split| split.keep(&kept));
        }
        let points = self.course.points.iter_mut().flat_map(|(_, states)| states);
        points.for_each(|split| split.keep(&kept));
        self
    }

    /// The budget as TOML: `sources`, and a table `[[state]]` for each axis. 1σ in the SI unit of the axis, shares of the
    /// variance in the order of `sources`.
    #[must_use]
    pub fn toml(&self) -> String {
        let list = |values: Vec<String>| format!("[{}]", values.join(", "));
        let quoted = |text: &String| format!("{text:?}");
        let mut out = format!(
            "# Error budget with the gains of one run. Shares are of the variance, in the order of `sources`.\n\
             description = {:?}\nprovenance = {:?}\nsources = {}\noutside = {}\n",
            self.description,
            self.provenance.line(),
            list(self.sources.iter().map(quoted).collect()),
            list(self.outside.iter().map(quoted).collect()),
        );
        for rows in &self.rows {
            let _ = write!(
                out,
                "\n[[sensor]]\nname = {:?}\nused = {}\nrejected = {}\n",
                rows.name, rows.used, rows.rejected
            );
        }
        for state in &self.states {
            let _ = write!(
                out,
                "\n[[state]]\nstate = {:?}\naxis = {:?}\nunit = {:?}\n",
                state.state, state.axis, state.unit
            );
            let timed = state.at.iter().map(|split| (format!("at.{:?}", split.time.to_string()), split));
            let named = [("end".to_owned(), &state.end), ("rms".to_owned(), &state.rms)];
            for (name, split) in named.into_iter().chain(timed) {
                let shares = (0..self.sources.len()).map(|source| split.share(source));
                // TOML writes a missing share as `nan` too.
                let shares = shares.map(|share| if share.is_nan() { "nan".to_owned() } else { format!("{share:?}") });
                let _ = writeln!(
                    out,
                    "{name} = {{ sigma = {:?}, filter_sigma = {:?}, shares = {} }}",
                    split.sigma(),
                    math::sqrt(split.filter),
                    list(shares.collect())
                );
            }
        }
        out
    }
}
