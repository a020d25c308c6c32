//! The score inside and outside declared episodes.
//!
//! A trial has stretches with disturbances that the filter does not know: trenching, a zone of reflections. Errors and
//! consistency inside them show how the filter copes. Those outside show if it is sound.

use super::comparison::{Deviation, EpochError};
use super::nees::NeesSeries;
use super::{Axes, Consistency};
use crate::score::scorer::Sums;
use fusion_core::math;
use fusion_models::fault::Windows;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The score of a part of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
pub struct PartScore {
    /// Epochs with a position in it.
    pub epochs: usize,
    /// Position error, north east down \[m\].
    pub position: Option<Axes>,
    /// RMS of the horizontal error \[m\]; NaN without a position.
    pub horizontal_rms: f64,
    /// NEES of position, velocity, attitude. If the part has gaps, its band treats the epochs before and after a gap as
    /// neighbours.
    pub nees: [Option<Consistency>; 3],
}

/// The score in the declared episodes and outside them.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
pub struct Episodes {
    /// Inside any episode.
    pub during: PartScore,
    /// Outside all episodes.
    pub outside: PartScore,
}

impl Episodes {
    /// Both parts, each with its name.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, &PartScore)> {
        [("during episodes", &self.during), ("outside episodes", &self.outside)].into_iter()
    }
}

/// Scores both parts as a run goes.
#[derive(Debug, Default)]
pub(super) struct EpisodeScorer {
    windows: Windows,
    during: Part,
    outside: Part,
}

#[derive(Debug, Default)]
struct Part {
    position: Sums,
    horizontal: f64,
    nees: [NeesSeries; 3],
}

fusion_core::memory!(EpisodeScorer { during, outside; windows });
fusion_core::memory!(Part {
    position,
    horizontal,
    nees
});

impl EpisodeScorer {
    pub(super) fn new(windows: Windows) -> Self {
        Self {
            windows,
            during: Part::default(),
            outside: Part::default(),
        }
    }

    /// Takes the error at an epoch that counts. `nees` is true if NEES counts there, and `attitude` if the NEES of
    /// attitude does.
    pub(super) fn add(&mut self, error: &EpochError, nees: bool, attitude: bool) {
        let is_during = self.windows.contains(error.time());
        let part = if is_during { &mut self.during } else { &mut self.outside };
        if let Some(d) = &error.position {
            part.position.add(error.time(), d);
            // 0 if it is not known; then it is not counted.
            part.horizontal += math::powi(d.error.x, 2) + math::powi(d.error.y, 2);
        }
        let body = error.attitude.as_ref().map(|a| &a.body).filter(|_| attitude);
        let deviations: [Option<&Deviation>; 3] = [error.position.as_ref().filter(|d| d.is_horizontal()), error.velocity.as_ref(), body];
        for (series, deviation) in part.nees.iter_mut().zip(deviations).filter(|_| nees) {
            deviation.into_iter().for_each(|d| series.add_deviation(d));
        }
    }

    pub(super) fn finish(self) -> Episodes {
        let [during, outside] = [self.during, self.outside].map(Part::finish);
        Episodes { during, outside }
    }
}

impl Part {
    fn finish(self) -> PartScore {
        let count = self.position.count();
        PartScore {
            epochs: count as usize,
            position: self.position.axes(),
            horizontal_rms: math::sqrt(self.horizontal / self.position.horizontal()),
            nees: self.nees.map(|series| series.consistency()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Comparison, ReferenceEpoch, Rules, Scorer};
    use crate::solution::Solution;
    use fusion_core::geometry::wgs84::Geodetic;
    use fusion_core::time::Time;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn an_epoch_counts_in_an_episode_or_outside() {
        #[derive(serde::Deserialize)]
        struct File {
            episodes: fusion_models::fault::Windows,
        }
        let file: File = toml::from_str("episodes = [{ from = 2, to = 4 }, { from = 6, to = 7 }]").unwrap();
        let rules = Rules {
            episodes: Some(file.episodes),
            from: Some(Time::from_seconds(1.0)),
            ..Rules::default()
        };
        let origin = Geodetic::new(0.6, 0.1, 0.0);
        let place = |north: f64| origin.offset(&Vector3::new(north, 0.0, 0.0));
        let time = |k: u32| Time::from_seconds(f64::from(k));
        let truth = (0..9).map(|k| ReferenceEpoch {
            time: time(k),
            position: Some(origin),
            ..ReferenceEpoch::default()
        });
        let (mut scorer, mut comparison) = (Scorer::new(rules), Comparison::new(Vector3::zeros(), truth));
        for k in 0..9 {
            let estimate = Solution {
                time: time(k),
                position: Some((place(if matches!(k, 2 | 3 | 6) { 4.0 } else { 1.0 }), Matrix3::identity())),
                ..Solution::default()
            };
            let mut add = |_: &ReferenceEpoch, error: Option<&super::EpochError>| {
                error.into_iter().for_each(|error| scorer.add(error));
                Ok::<_, core::convert::Infallible>(())
            };
            comparison.reach(&estimate, None, &mut add).unwrap();
        }
        let found = scorer.finish().episodes.unwrap();
        // The last epoch still waits for a later estimate. 1e-5: two charts of the ellipsoid metres apart.
        for (part, epochs, rms) in [(&found.during, 3, 4.0), (&found.outside, 5, 1.0)] {
            assert_eq!(part.epochs, epochs, "{found:?}");
            assert!((part.horizontal_rms - rms).abs() < 1e-5 && (part.nees[0].unwrap().mean - rms * rms).abs() < 1e-4);
        }
    }
}
