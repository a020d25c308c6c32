//! The score of a filter, from the errors that are reported.

use super::{Entry, Heard, Listed, RunEnd, RunEvent, RunObserver, RunStart, Section, SectionObserver, Summary};
use crate::score::{BlockScorer, Rules, Score, Scorer};
use fusion_core::filter::{Update, Verdict};
use fusion_core::math;
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt};
use schemars::JsonSchema;
use serde::Serialize;

/// Scores one filter.
#[derive(Debug)]
pub(crate) struct FilterScore {
    /// The filter's number.
    filter: usize,
    /// The names of its sensors.
    sensors: Vec<String>,
    scorer: Scorer,
    blocks: BlockScorer,
}

impl FilterScore {
    /// A score without errors yet. The truth of the blocks with `is_drawn` will be reported.
    #[must_use]
    pub fn new(filter: &Heard, rules: Rules, is_drawn: impl Fn(&str) -> bool) -> Self {
        Self {
            filter: filter.number,
            sensors: filter.sensors.iter().map(|s| s.name.clone()).collect(),
            blocks: BlockScorer::new(&filter.layout, rules.from, is_drawn),
            scorer: Scorer::new(rules),
        }
    }

    /// The score at the end of a run.
    fn score(mut self, end: &RunEnd<'_>) -> Score {
        self.scorer.align(end.shared.aligned.get(self.filter).copied().flatten());
        Score {
            blocks: self.blocks.finish(),
            ..self.scorer.finish()
        }
    }
}

impl Section for Score {
    const NAME: &'static str = "score";
}

impl SectionObserver for FilterScore {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        Ok(self.score(end).into())
    }
}

/// The score of a filter inside a stage. Its sensors and parameters are listed with those of the other filters.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct InsideScore {
    /// The stage's name, after those of the stages around it, with dots.
    pub filter: String,
    /// Its score against the reference.
    pub score: Score,
}

impl Listed for InsideScore {
    const NAME: &'static str = "inside";
}

impl Summary {
    /// The score against the reference; `None` without a reference.
    #[must_use]
    pub fn score(&self) -> Option<&Score> {
        self.get()
    }

    /// The scores of the filters inside stages.
    #[must_use]
    pub fn inside(&self) -> &[InsideScore] {
        self.list()
    }
}

/// Scores the filters inside stages.
#[derive(Debug)]
pub(crate) struct InsideScores {
    /// By filter; its name, and its score.
    filters: Box<[(String, FilterScore)]>,
}

impl InsideScores {
    /// The scores of all filters of a run but the outermost; none without a reference.
    #[must_use]
    pub fn new(start: &RunStart<'_>) -> Self {
        let inside = start.filters.iter().filter(|filter| !filter.is_outermost());
        let scores = inside.filter_map(|filter| Some((filter.stages.join("."), start.score(filter)?)));
        Self { filters: scores.collect() }
    }
}

impl Memory for InsideScores {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.filters.iter_mut().for_each(|(_, score)| score.remember(tape));
    }
}

impl RunObserver for InsideScores {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        self.filters.iter_mut().try_for_each(|(_, score)| score.on(event))
    }
}

impl SectionObserver for InsideScores {
    fn finish(self: Box<Self>, end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let filters = self.filters.into_iter();
        let scores = filters.map(|(filter, score)| InsideScore {
            filter,
            score: score.score(end),
        });
        Ok(scores.collect::<Vec<_>>().into())
    }
}

fusion_core::memory!(FilterScore { scorer, blocks; filter, sensors });

impl RunObserver for FilterScore {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Reference {
                filter,
                error: Some(error),
                ..
            } if filter.number == self.filter => self.scorer.add(error),
            RunEvent::Truth { filter, belief, truth } if filter.number == self.filter => self.blocks.add(belief, truth),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, row },
            } if filter.number == self.filter => {
                if matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired) {
                    self.scorer.used(*sensor, row.stamp, *time);
                    if let Some(name) = self.sensors.get(*sensor) {
                        self.scorer.moved(*sensor, name, *time, moved(update));
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// How far a measurement moved the measured quantity, in 1σ of the estimate before it. The innovation r with variance
/// S, of which HPHᵀ = S − R is the estimate's part, moves it by r HPHᵀ/S. Returns the largest value over the rows, each
/// row alone.
fn moved(update: &Update<'_>) -> f64 {
    let rows = update.innovation_sigma.len();
    let of = |k: usize| {
        let noise = update.noise.get(k * (rows + 1)).copied().unwrap_or_default();
        let own = math::powi(update.innovation_sigma[k], 2) - noise;
        update.residual[k].abs() * math::sqrt(own.max(0.0)) / (own + noise / update.weight)
    };
    // A row without information gives NaN.
    (0..rows.min(update.residual.len())).map(of).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_core::gate::Mode;

    #[test]
    fn a_measurement_moves_the_estimate_by_the_part_of_the_innovation_that_is_its_own() {
        let update = Update {
            verdict: Verdict::Accepted,
            value: &[],
            predicted: &[],
            // 1σ of 4 m against 3 m of the estimate, and a row that cannot move it.
            noise: &[16.0, 0.0, 0.0, 1.0],
            residual: &[10.0, 9.0],
            innovation_sigma: &[5.0, 1.0],
            innovation_factor: &[],
            nis: 0.0,
            statistic: 0.0,
            threshold: f64::INFINITY,
            mode: Mode::Track,
            power: &[],
            weight: 1.0,
            rivals: fusion_core::filter::Rivals::NONE,
            jacobian: None,
        };
        // By 10 · 9/25 m = 3.6 m, of 3 m; with a weight of one half by 10 · 9/41 m. 1e-15: rounding.
        assert!((moved(&update) - 1.2).abs() < 1e-15);
        let half = Update { weight: 0.5, ..update };
        assert!((moved(&half) - 10.0 * 3.0 / 41.0).abs() < 1e-15);
    }
}
