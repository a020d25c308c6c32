//! The estimated parameters over time: biases, scale factors, lever arms, delays.

use super::trace::Trace;
use crate::run::axes;
use fusion::observe::{Filters, Heard, Thinning};
use fusion::run::FinalState;
use fusion_core::belief::Belief;
use fusion_core::memory::{Memory, Tape};
use fusion_core::state::StateRole;
use fusion_tables::Unit;

/// Parameters are drawn this often at most \[ns\]: they change slowly, at 10 Hz every jump shows.
const PERIOD: i64 = 100_000_000;
/// Buckets of a series: as many as a plot of half the page has pixels.
const BUCKETS: usize = 1024;

/// Those of all filters of a design.
#[derive(Clone, Debug, Default)]
pub(super) struct Parameters(Vec<OfFilter>);

/// Those of one filter.
#[derive(Clone, Debug)]
struct OfFilter {
    thinning: Thinning,
    tracks: Box<[ParameterTrack]>,
}

/// One axis of a parameter.
#[derive(Clone, Debug)]
pub(super) struct ParameterTrack {
    /// `imu.gyro_bias x`.
    pub name: String,
    /// The unit in which it is shown.
    pub unit: Unit,
    /// Value and 3σ.
    pub estimate: Trace,
    /// The value that the simulation drew.
    pub truth: Trace,
}

fusion_core::memory!(OfFilter { thinning, tracks });
fusion_core::memory!(ParameterTrack { estimate, truth; name, unit });

impl Memory for Parameters {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.as_mut_slice().remember(tape);
    }
}

impl Parameters {
    /// The parameters of these filters, without a value yet.
    pub(super) fn of(filters: &Filters) -> Self {
        Self(filters.iter().map(OfFilter::new).collect())
    }

    /// An estimate of a filter.
    pub(super) fn estimate(&mut self, filter: &Heard, belief: &Belief) {
        let Some(own) = self.0.get_mut(filter.number) else { return };
        if own.tracks.is_empty() || !own.thinning.takes(belief.time) {
            return;
        }
        let states = FinalState::of(&filter.layout, belief);
        for (track, (_, value, sigma)) in own.tracks.iter_mut().zip(states.iter().flat_map(axes)) {
            let row = [track.unit.of(value), 3.0 * track.unit.of(sigma)];
            track.estimate.push(belief.time.seconds(), &row);
        }
    }

    /// The true state that belongs to the latest estimate of a filter.
    pub(super) fn truth(&mut self, filter: &Heard, belief: &Belief, truth: &[f64]) {
        let Some(own) = self.0.get_mut(filter.number) else { return };
        let t = belief.time.seconds();
        // Only for the estimates that are drawn.
        if own
            .tracks
            .first()
            .and_then(|track| track.estimate.span())
            .is_none_or(|span| span.1 != t)
        {
            return;
        }
        let mut states = FinalState::of(&filter.layout, belief);
        let blocks = filter.layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic);
        for (state, block) in states.iter_mut().zip(blocks) {
            if let Some(own) = truth.get(block.storage_range()) {
                state.value.copy_from_slice(own);
            }
        }
        for (track, (_, value, _)) in own.tracks.iter_mut().zip(states.iter().flat_map(axes)) {
            track.truth.push(t, &[track.unit.of(value)]);
        }
    }

    /// Every axis of every parameter that has an estimate.
    pub(super) fn tracks(&self) -> impl Iterator<Item = &ParameterTrack> {
        let all = self.0.iter().flat_map(|filter| &filter.tracks);
        all.filter(|track| !track.estimate.is_empty())
    }
}

impl OfFilter {
    fn new(filter: &Heard) -> Self {
        let parameters = filter.layout.blocks().iter().filter(|b| b.role != StateRole::Kinematic);
        let tracks = parameters.flat_map(|block| {
            let mut value = vec![0.0; block.kind.storage()];
            block.kind.write_origin(&mut value);
            let blank = FinalState {
                name: filter.named(&block.name),
                kind: block.kind,
                value,
                sigma: vec![0.0; block.kind.dim()],
                start_sigma: Vec::new(),
                covariance: vec![0.0; block.kind.dim() * block.kind.dim()],
                unit: block.unit,
            };
            let unit = Unit::of_si(block.unit);
            let named = axes(&blank).into_iter().map(move |(axis, ..)| ParameterTrack {
                name: format!("{} {axis}", blank.name).trim_end().to_owned(),
                unit: unit.clone(),
                estimate: Trace::new(2, BUCKETS),
                truth: Trace::new(1, BUCKETS),
            });
            named.collect::<Vec<_>>()
        });
        Self {
            thinning: Thinning::new(PERIOD),
            tracks: tracks.collect(),
        }
    }
}
