//! Runs the comparisons in order. Each mistake found is corrected for the later comparisons.

use super::free;
use super::log::{self, Track};
use super::mistake::{Remedy, at};
use super::regression::Fits;
use fusion::config::{Diagnostics, Node};
use fusion::design::Design;
use fusion::run::Options;

/// A comparison and its result.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The channel, `source.channel`, or another item that is judged.
    pub what: String,
    /// The other side of the comparison.
    pub with: String,
    /// Samples.
    pub samples: usize,
    /// The correlation along each axis that could be compared.
    pub correlation: Vec<f64>,
    /// How much better another explanation is than the declared one, in standard errors. It covers the axes that the
    /// data determine; zero if no other explanation is better.
    pub margin: f64,
    /// The result in words.
    pub verdict: String,
}

impl Comparison {
    /// A comparison without axes.
    pub(super) fn plain(what: String, with: &str, samples: usize, verdict: impl Into<String>) -> Self {
        Self {
            what,
            with: with.to_owned(),
            samples,
            correlation: Vec::new(),
            margin: 0.0,
            verdict: verdict.into(),
        }
    }

    /// A comparison along axes.
    pub(super) fn along(what: String, with: &str, fits: &Fits, verdict: String) -> Self {
        let fitted = || fits.iter().flatten();
        Self {
            correlation: fitted().map(|f| f.correlation).collect(),
            margin: fitted().filter(|f| f.is_clear()).map(|f| f.margin).fold(0.0, f64::max),
            ..Self::plain(what, with, fitted().map(|f| f.count).max().unwrap_or(0), verdict)
        }
    }
}

/// The results for the frames of a design.
#[derive(Debug, Default)]
pub struct Judged {
    /// The comparisons that were possible.
    pub comparisons: Vec<Comparison>,
    /// The mistakes, as warnings at the place of the declaration.
    pub mistakes: Diagnostics,
}

/// The current trial.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The trial in words.
    pub what: &'a str,
    /// The number of runs that are finished ...
    pub done: usize,
    /// ... out of this number. Their results decide whether more runs follow.
    pub all: usize,
}

/// Compares the recorded channels of a design with one another, and its fixed parameters with its filter's estimates.
/// Several threads report each trial to `progress`.
///
/// # Errors
/// Errors in the data.
pub fn judge(design: &Design, options: &Options, progress: &(dyn Fn(Step<'_>) + Sync)) -> Result<Judged, Diagnostics> {
    if design.simulation.is_some() {
        return Ok(Judged::default());
    }
    let mut judge = Judge {
        design,
        options,
        tracks: log::read(design, options)?,
        found: Judged::default(),
        mended: Vec::new(),
    };
    let has_time = judge.stamps();
    judge.places();
    let velocities = judge.velocities();
    let attitude = judge.attitude(&velocities);
    judge.instruments(&velocities, attitude.as_ref());
    judge.fields();
    // Values that are close together in time are averaged.
    if has_time {
        judge.ranges();
    }
    let mut found = judge.found;
    // Parameters are judged only if everything else is right.
    if found.mistakes.is_empty() {
        free::judge(design, options, progress, &mut found)?;
    } else {
        found.comparisons.push(free::untried("not judged while something else is wrong"));
    }
    Ok(found)
}

pub(super) struct Judge<'a> {
    pub(super) design: &'a Design,
    pub(super) options: &'a Options,
    pub(super) tracks: Vec<Track>,
    pub(super) found: Judged,
    /// The tracks that were corrected.
    pub(super) mended: Vec<(usize, &'static str)>,
}

/// The channels of the design, and the list of results.
impl Judge<'_> {
    pub(super) fn node(&self, track: &Track) -> &Node {
        &self.design.sources[track.source].node
    }

    /// The table of a channel in the design.
    pub(super) fn channel(&self, track: &Track) -> Option<&Node> {
        self.node(track).at(&format!("channels.{}", track.channel))
    }

    /// The path of this table.
    pub(super) fn table(&self, track: &Track) -> String {
        format!("source.{}.channels.{}", self.design.sources[track.source].name, track.channel)
    }

    pub(super) fn name(&self, track: &Track) -> String {
        format!("{}.{}", self.design.sources[track.source].name, track.channel)
    }

    /// The name, with a remark if the track was corrected.
    pub(super) fn named(&self, track: &Track) -> String {
        let is_mended = self.mended.contains(&(track.source, track.channel));
        self.name(track) + if is_mended { ", put right" } else { "" }
    }

    pub(super) fn is_reference(&self, track: &Track) -> bool {
        let name = &self.design.sources[track.source].name;
        self.design.reference.as_ref().is_some_and(|r| r.block.source.has(name))
    }

    pub(super) fn all(&self, channel: &str) -> Vec<Track> {
        self.tracks.iter().filter(|t| t.channel == channel).cloned().collect()
    }

    pub(super) fn beside(&self, track: &Track, channel: &str) -> Option<Track> {
        self.tracks
            .iter()
            .find(|t| t.source == track.source && t.channel == channel)
            .cloned()
    }

    /// Continues with the corrected track.
    pub(super) fn replace(&mut self, track: Track) {
        self.mended.push((track.source, track.channel));
        if let Some(old) = self.tracks.iter_mut().find(|t| t.is(&track)) {
            *old = track;
        }
    }

    /// Lists the comparison of a channel.
    pub(super) fn list(&mut self, track: &Track, with: &str, samples: usize, verdict: impl Into<String>) {
        let listed = Comparison::plain(self.name(track), with, samples, verdict);
        self.found.comparisons.push(listed);
    }

    /// Reports a mistake in the table of a channel, at a key.
    pub(super) fn accuse(&mut self, track: &Track, rule: &'static str, key: &str, message: String, remedy: Remedy) {
        let told = at(rule, self.node(track), track.channel, key, message);
        self.found.mistakes.push(remedy.of(told, &self.table(track)));
    }
}
