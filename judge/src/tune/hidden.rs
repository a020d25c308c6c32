//! Why a log does not identify a noise, and which motion would.
//!
//! ```text
//! noise ──▶ Q with the noise raised ──▶ the states that it moves ──▶ observability: their σ, and the motion that says most
//!      └──▶ S with the noise raised ──▶ its share of the innovations' variance, segment by segment
//! ```
//!
//! A noise shows only in states that the motion determines. If it determines none of those that the noise moves, the motion
//! that says most about them has to last longer, or to be repeated. Otherwise the measurements see the noise, and what
//! else is in the innovations hides it.
//!
//! Not here   logs after the first; backends without a covariance

use super::sensitivity::{Said, Sensitivity};
use super::trials::Trials;
use super::{Log, Settings, Tuned};
use crate::likelihood::densities;
use crate::observability::{DECISIVE, Observability, Segment, State, observability};
use fusion::config::{Diagnostics, Document};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, run_sharing};
use fusion_core::filter::Step;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::Layout;
use fusion_models::sim::SharedCourse;
use std::sync::Arc;

/// Why a log does not identify a noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// The path of the noise.
    pub parameter: String,
    /// The state that it moves and that the log says most about, if the log determines none of the states that it moves.
    pub unobserved: Option<Unobserved>,
    /// Its share of the innovations that say most about it; `None` if it changes no innovation.
    pub share: Option<Share>,
}

/// A state that a motion does not determine.
#[derive(Clone, Debug, PartialEq)]
pub struct Unobserved {
    /// Its name.
    pub state: String,
    /// The smallest σ along the log, given all data, over the initial σ.
    pub left: f64,
    /// The motion that says most about it, and the factor by which its σ grows without that motion; `None` if none says
    /// anything.
    pub motion: Option<(String, f64)>,
}

/// The share of a noise in innovations.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// The sensor.
    pub sensor: String,
    /// The share of the variance of its innovations.
    pub share: f64,
    /// The motion in which a second says most about the noise, and the share there; `None` if no motion says at least
    /// [`DECISIVE`] times as much as the log on average.
    pub motion: Option<(String, f64)>,
}

/// Why the first log does not identify the noises that `tuned` calls not identifiable.
///
/// # Errors
/// Mistakes of the designs or their data.
pub fn hidden(logs: &[Log], tuned: &Tuned, settings: &Settings) -> Result<Vec<Hidden>, Diagnostics> {
    let wanted: Vec<usize> = (0..tuned.found.len()).filter(|j| !tuned.found[*j].is_identifiable()).collect();
    let Some(log) = logs.first().filter(|_| !wanted.is_empty()) else {
        return Ok(Vec::new());
    };
    let mut document = log.document.clone();
    tuned.edits().iter().try_for_each(|edit| document.apply(edit))?;
    let design = Design::read(document.clone())?;
    let factor = |j: usize| tuned.found[j].edit().map_or(1.0, |_| tuned.found[j].factor);
    let parameters = tuned.found.iter().map(|found| found.parameter.clone()).collect();
    let mut trials = Trials::new(&logs[..1], parameters, densities(&design), settings);
    let theta: Vec<f64> = (0..tuned.found.len()).map(|j| math::ln(factor(j))).collect();
    trials.fix_rows()?;
    let base = trials.at(&theta)?;
    let sensitivity = Sensitivity::new(&trials, &theta, &wanted, &base)?;
    // A filter without a covariance has no observability.
    let found = observability(&design, &log.options, &[], &mut |_| {}).ok();
    let declared = Disturbed::of(&document, &log.options)?;
    let of = |(k, j): (usize, &usize)| {
        let parameter = &trials.parameters[*j];
        let mut raised = document.clone();
        raised.apply(&parameter.times(RAISED * factor(*j), None))?;
        let blocks = declared.moved(&Disturbed::of(&raised, &log.options)?);
        let said: Vec<Said> = sensitivity.said(k).collect();
        Ok(Hidden {
            parameter: parameter.path.clone(),
            unobserved: found.as_ref().and_then(|found| unobserved(found, &blocks)),
            share: share(&design, &said, found.as_ref().map_or(&[], |found| &found.segments)),
        })
    };
    wanted.iter().enumerate().map(of).collect()
}

/// The factor of a noise by which its part of Q is found: any other one would do.
const RAISED: f64 = 2.0;

/// The process noise of a run: Q, summed over its steps.
#[derive(Default)]
struct Disturbed {
    layout: Option<Arc<Layout>>,
    variance: Vec<f64>,
}

impl Disturbed {
    fn of(document: &Document, options: &Options) -> Result<Self, Diagnostics> {
        let mut heard = Self::default();
        run_sharing(
            &Design::read(document.clone())?,
            options,
            &SharedCourse::default(),
            &mut [&mut heard],
        )?;
        Ok(heard)
    }

    /// The names of the blocks that a noise moves, by the process noise with the noise raised: those of whose process noise
    /// it makes most.
    fn moved(&self, raised: &Self) -> Vec<String> {
        /// Less is what another estimate changes in Q.
        const NONE: f64 = 0.01;
        let Some(layout) = &self.layout else { return Vec::new() };
        let grown = |i: usize| (raised.variance[i] - self.variance[i]).abs() / self.variance[i].max(f64::MIN_POSITIVE);
        let of_block = |range: core::ops::Range<usize>| range.map(grown).fold(0.0, f64::max);
        let each: Vec<(String, f64)> = layout
            .blocks()
            .iter()
            .map(|b| (b.name.clone(), of_block(b.tangent_range())))
            .collect();
        let most = each.iter().map(|(_, grown)| *grown).fold(NONE, f64::max);
        each.into_iter()
            .filter(|(_, grown)| *grown >= 0.5 * most)
            .map(|(name, _)| name)
            .collect()
    }
}

impl RunObserver for Disturbed {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else {
            return Ok(());
        };
        if let Event::Step(Step::Predicted { transition, .. }) = event
            && filter.is_outermost()
        {
            let layout = self.layout.get_or_insert_with(|| filter.layout.clone());
            self.variance.resize(layout.dim(), 0.0);
            let noise = transition.noise_before().chain(transition.noise_after());
            noise.filter(|(i, j, _)| i == j).for_each(|(i, _, value)| self.variance[i] += value);
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

/// The state of some blocks about which the log says most, if it determines none of them.
fn unobserved(found: &Observability, blocks: &[String]) -> Option<Unobserved> {
    let states: Vec<&State> = blocks.iter().flat_map(|block| found.of_block(block)).collect();
    if states.iter().any(|state| state.is_identifiable()) {
        return None;
    }
    let state = states.into_iter().min_by(|a, b| a.left.total_cmp(&b.left))?;
    Some(Unobserved {
        state: state.name.clone(),
        left: state.left,
        motion: found.most_is_said_by(state).map(|(cause, factor)| (found.name_of(cause), factor)),
    })
}

/// The share of a noise in the innovations of the sensor that says most about it.
fn share(design: &Design, said: &[Said], segments: &[Segment]) -> Option<Share> {
    let information = |of: &dyn Fn(&&Said) -> bool| said.iter().filter(of).map(|own| own.information).sum::<f64>();
    let by_sensor = (0..design.sensors.len()).map(|sensor| (sensor, information(&|own| own.sensor == sensor)));
    let (sensor, all) = by_sensor.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, all)| *all > 0.0)?;
    let own: Vec<&Said> = said.iter().filter(|own| own.sensor == sensor).collect();
    let mean = |rows: &[&Said]| rows.iter().map(|own| own.share).sum::<f64>() / rows.len() as f64;
    let seconds: f64 = segments.iter().map(|segment| segment.to - segment.from).sum();
    let within = |segment: &Segment| -> Vec<&Said> {
        let holds = |own: &&&Said| (segment.from..segment.to).contains(&own.time);
        own.iter().filter(holds).copied().collect()
    };
    let rate = |segment: &Segment| {
        let inside: f64 = within(segment).iter().map(|own| own.information).sum();
        inside / (segment.to - segment.from)
    };
    let most = segments.iter().max_by(|a, b| rate(a).total_cmp(&rate(b)));
    let most = most.filter(|segment| rate(segment) >= DECISIVE * all / seconds);
    Some(Share {
        sensor: design.sensors[sensor].name.clone(),
        share: mean(&own),
        motion: most.map(|segment| (segment.to_string(), mean(&within(segment)))),
    })
}
