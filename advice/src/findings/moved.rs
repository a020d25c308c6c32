//! Calibrations that moved while innovations were too large.

use super::Finding;
use super::facts::Facts;
use super::instrument::{Instrument, Measures, Reports};
use crate::inspect::{Kind, reported_by_name};
use fusion::config::Edit;
use fusion::observe::{Excess, Moved};
use fusion_core::math;
use fusion_tables::{Unit, short};

/// So many calibrations are named.
const NAMED: usize = 3;

impl Facts<'_> {
    /// Sensors that moved calibrations far while their innovations were too large, the worst first, but for those that are
    /// `told` already: it is said with what else is wrong with them.
    pub(super) fn moved(&self, told: impl Fn(&str) -> bool) -> Vec<Finding> {
        let own = self.instruments.iter().filter(|i| !told(&i.name));
        let mut all: Vec<(&Instrument, Excess)> = own.filter_map(|i| Some((i, self.excess(&i.name)?))).collect();
        all.sort_by(|a, b| ratio(&b.1).total_cmp(&ratio(&a.1)));
        let found = all.into_iter().map(|(i, excess)| self.moved_by(i, &excess));
        found.collect()
    }

    /// The calibrations that a sensor moved, except those that a sensor with larger innovations moved at the same time. Where
    /// one sensor throws the estimate off, the others disagree with it.
    fn excess(&self, sensor: &str) -> Option<Excess> {
        let all = self.run.excesses;
        let own = all.iter().find(|e| e.sensor == sensor)?;
        let is_larger = |other: &&Excess| ratio(other) > ratio(own) && other.from < own.to && own.from < other.to;
        let mut own = own.clone();
        own.moved
            .retain(|m| !all.iter().filter(|other| is_larger(other)).any(|other| other.moves(&m.name)));
        (!own.moved.is_empty()).then_some(own)
    }

    fn moved_by(&self, sensor: &Instrument, excess: &Excess) -> Finding {
        let times = math::sqrt(ratio(excess));
        let name = &sensor.name;
        let first = &excess.moved[0].name;
        let (reported, edits) = self.reported(sensor).unzip();
        let advice = match reported {
            Some(reported) => format!(
                "the 1σ of `{first}` does not include that: {reported}; if innovations are still too large then, multiply the reported 1σ \
                 (`scale`), or `{first}` was worse known before than its 1σ said"
            ),
            None => format!(
                "the 1σ of `{first}` does not include that: either the `noise` of `{name}` is {} times too small then, or `{first}` was \
                 worse known before than its 1σ said, or both follow from a poor start",
                short(times)
            ),
        };
        Finding {
            about: name.clone(),
            evidence: format!(
                "innovations of `{name}` were {} times what is expected from {:.1} s to {:.1} s (mean NIS {} of {} over {} \
                 measurements), and {}",
                short(times),
                excess.from,
                excess.to,
                short(excess.nis),
                excess.dof,
                excess.measurements,
                moves(&excess.moved)
            ),
            advice,
            edits: edits.unwrap_or_default(),
            ..Finding::of("parameter-moved")
        }
    }

    /// That a sensor moved calibrations, for a finding about its innovations; empty where it did not.
    pub(super) fn moved_too(&self, sensor: &Instrument) -> String {
        let excess = self.excess(&sensor.name);
        excess.map_or_else(String::new, |e| {
            format!("; from {:.1} s to {:.1} s {}", e.from, e.to, moves(&e.moved))
        })
    }

    /// How a sensor takes the 1σ that its file reports row by row, where it does not: the words and the edits.
    pub(super) fn reported(&self, sensor: &Instrument) -> Option<(String, Vec<Edit>)> {
        let Reports {
            channel,
            width,
            is_declared,
            sigma,
        } = sensor.reports.as_ref()?;
        let source = self.run.sources.iter().find(|s| s.name == sensor.source)?;
        let noise = Edit::set(
            format!("sensor.{}.noise", sensor.name),
            format!("{{ sigma = {sigma}, from_source = true }}"),
        );
        if *is_declared {
            let words = format!("`{}` reports the 1σ of each row in its channel `{channel}`: {noise}", source.name);
            return Some((words, vec![noise]));
        }
        let kind = match sensor.measures? {
            Measures::Position => Kind::PositionSigma,
            Measures::Velocity => Kind::VelocitySigma,
            Measures::Attitude => return None,
        };
        let all = reported_by_name(&source.report.unread);
        let found = all.iter().find(|r| r.kind == kind && r.columns.len() >= *width)?;
        let mut names: Vec<String> = found.columns.iter().map(|name| format!("`{name}`")).collect();
        names.dedup();
        let columns = Edit::set(format!("source.{}.channels.{channel}", source.name), found.channel(*width));
        let words = format!(
            "the file of `{0}` reports the 1σ of each row in columns that `{0}` does not read, {1}: {columns} and {noise}",
            source.name,
            names.join(", ")
        );
        Some((words, vec![columns, noise]))
    }
}

/// The mean NIS over what it should be.
fn ratio(excess: &Excess) -> f64 {
    excess.nis / excess.dof as f64
}

/// `` `gnss.time_offset` moved from 0.1 to -0.18 s, 5.6 times the 1σ of 0.05 s that it had``.
fn moves(moved: &[Moved]) -> String {
    let each = moved.iter().take(NAMED).map(|m| {
        let unit = Unit::of_si(&m.unit);
        let [from, to, sigma] = [m.from, m.to, m.sigma].map(|v| short(unit.of(v)));
        let axis = if m.is_vector {
            format!(" (axis {})", m.axis + 1)
        } else {
            String::new()
        };
        format!(
            "`{}`{axis} moved from {from} to {to} {unit}, {} times the 1σ of {sigma} {unit} that it had",
            m.name,
            short(m.sigmas),
            unit = unit.symbol()
        )
    });
    let named = each.collect::<Vec<_>>().join(", ");
    match moved.len().saturating_sub(NAMED) {
        0 => named,
        more => format!("{named}, and {more} more"),
    }
}
