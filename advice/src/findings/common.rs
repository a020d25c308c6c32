//! Findings about a reference that reads the instrument of a sensor, and about a late process input.

use super::facts::Facts;
use super::instrument::Measures;
use super::level::sigmas;
use super::stamps::{Common, Delay};
use super::{Finding, is_large};
use fusion::config::Edit;
use fusion::score::Offset;

/// Smaller differences of a latency \[s\] and of a point \[m\] are not reported: the centre of an antenna is hardly
/// better known.
const LEAST_LATENCY: f64 = 0.01;
const LEAST_ARM: f64 = 0.02;
/// A time offset agrees with that of the reference if they differ by less than this share. The motion differs where
/// each was found.
const ALIKE: f64 = 0.25;

impl Facts<'_> {
    /// A reference that reads a sensor's instrument without the latency of that sensor, if errors are too large.
    pub(super) fn late_reference(&self) -> Vec<(Measures, Finding)> {
        let told = self.stamps.common.iter().filter(|c| {
            let off = (c.delay.seconds - c.latency).abs();
            let is_far = off > LEAST_LATENCY.max(sigmas(self.stamps.common.len()) * c.delay.sigma);
            // A row cannot be stamped before it is measured: then another clock is wrong.
            is_far && c.delay.seconds > 0.0 && self.nees(c.what).is_some_and(is_large)
        });
        let latency = |c: &Common| Edit::set(format!("{}.latency", c.channel), format!("\"{:.3} s\"", c.delay.seconds));
        let finding = |c: &Common| Finding {
            about: "reference".to_owned(),
            evidence: format!(
                "the reference reads the {} of the instrument of `{}`, which is late by {:.3} s{}, with a latency of {} s",
                c.what.word(),
                c.delay.sensor,
                c.delay.seconds,
                c.delay
                    .state
                    .as_ref()
                    .map_or(String::new(), |name| format!(" (by its state `{name}`)")),
                fusion_tables::short(c.latency)
            ),
            advice: format!("{}, for its rows are as late", latency(c)),
            edits: vec![latency(c)],
            ..Finding::of("reference-late")
        };
        let mut all: Vec<(Measures, Finding)> = told.map(|c| (c.what, finding(c))).collect();
        all.dedup();
        all
    }

    /// A reference that reads a sensor's instrument with a point that differs from the estimated lever arm.
    pub(super) fn other_arm(&self) -> Option<Finding> {
        let (point, differs_by) = (self.point, sigmas(3 * self.stamps.common.len()));
        let differs =
            |(arm, sigma): &([f64; 3], [f64; 3])| (0..3).any(|k| (arm[k] - point[k]).abs() > LEAST_ARM.max(differs_by * sigma[k]));
        let found = self.stamps.common.iter().filter(|c| c.what == Measures::Position);
        let (common, (arm, sigma)) = found.filter_map(|c| Some((c, c.arm?))).find(|(_, arm)| differs(arm))?;
        let listed = |v: [f64; 3]| v.map(|v| format!("{v:.3}")).join(", ");
        let edit = Edit::set("reference.lever_arm", format!("[{}]", listed(arm)));
        Some(Finding {
            about: "reference".to_owned(),
            evidence: format!(
                "the reference reads the positions of the instrument of `{}`, whose `lever_arm` is found at [{}] m, 1σ [{}] m, but is \
                 compared at [{}] m",
                common.delay.sensor,
                listed(arm),
                listed(sigma),
                listed(point)
            ),
            advice: format!("it is one point: {edit}, or, if the other was measured, give it to the sensor with `estimate = false`"),
            edits: vec![edit],
            ..Finding::of("reference-arm")
        })
    }

    /// The positions of the reference and of all sensors are early by the same time: then the process input is late.
    pub(super) fn late_input(&self, offset: &Offset) -> Option<(String, Edit)> {
        let is_alike = |d: &Delay| d.state.is_some() && (d.seconds - offset.latency).abs() < ALIKE * offset.latency.abs();
        let (first, all) = (self.stamps.of_position.first()?, &self.stamps.of_position);
        let (source, now) = self.stamps.input.as_ref().filter(|_| all.iter().all(is_alike))?;
        let state = first.state.as_deref().unwrap_or_default();
        let edit = Edit::set(format!("source.{source}.time.offset"), format!("\"{:.3} s\"", now + first.seconds));
        let advice = format!(
            "so is `{state}`, {:.3} s, and nothing is stamped before it is measured: the clock of the process input is late by as much; \
             {edit}, {:.3} s less than now, and make the `time_offset` of each sensor larger by as much",
            first.seconds, -first.seconds
        );
        Some((advice, edit))
    }
}
