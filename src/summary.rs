//! The summary of a run as it is printed, and what a reader must not overlook in it.

use crate::run::{FinalState, Summary};
use crate::score::{Axes, Consistency, Drift, Score};
use crate::table::{Table, WIDTH, count_cell, decimals, fixed, number, readable, wrapped};
use crate::tally::{SensorTally, counts, residual_rows};
use fusion_core::geometry::so3;
use fusion_core::state::{Attitude, Manifold};
use std::fmt;

/// Outages listed one by one; the rest is in summary.json.
const OUTAGES: usize = 20;

impl Consistency {
    /// `consistent`; `optimistic` where errors exceed what the filter claims; `pessimistic` where
    /// they stay below it.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self.mean {
            m if m > self.band.1 => "optimistic",
            m if m < self.band.0 => "pessimistic",
            _ => "consistent",
        }
    }
}

impl Summary {
    /// What a reader must not overlook, a sentence each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        if self.started.is_none() {
            let waits = self
                .waiting
                .iter()
                .map(|(name, what)| format!("`{name}` waits for {what}"))
                .collect::<Vec<_>>()
                .join("; ");
            all.push(match waits.as_str() {
                "" => "the filter never started: no data reached it".to_owned(),
                waits => format!("the filter never started: {waits}"),
            });
        }
        for s in self.sources.iter().filter(|s| s.used == 0) {
            all.push(format!("source `{}` delivered no rows ({} read)", s.name, s.rows));
        }
        for s in self.sensors.iter().filter(|_| self.started.is_some()) {
            let (good, bad) = (s.accepted + s.readopted, s.rejected + s.unusable);
            if good + bad == 0 {
                all.push(format!("sensor `{}` saw no measurement after the start", s.name));
            } else if bad > good {
                all.push(format!("sensor `{}`: {bad} of {} measurements were not used", s.name, good + bad));
            }
        }
        for (consumer, count) in &self.unused_rows {
            let rows = if *count == 1 { "1 row came" } else { &format!("{count} rows came") };
            all.push(format!(
                "`{consumer}`: {rows} too late, or held no number; `reorder` under [run] makes room for late ones"
            ));
        }
        all.extend(self.failures.iter().map(|f| format!("the estimator could not go on: {f}")));
        all
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.description.is_empty() {
            wrapped(&self.description, WIDTH)
                .iter()
                .try_for_each(|line| writeln!(f, "{line}"))?;
        }
        let mut facts = Table::new(&["", ""]);
        facts.row(["backend", &self.backend]);
        match self.started {
            Some(at) => facts.row(["started", &format!("at {at:.3} s")]),
            None => facts.row(["started", "never"]),
        }
        for (name, what) in &self.waiting {
            facts.row(["", &format!("`{name}` waits for {what}")]);
        }
        let cost = format!(
            "{} in {:.2} s, {:.0} ns each in the filter",
            self.epochs, self.wall_seconds, self.filter_ns_per_epoch
        );
        facts.row(["epochs", &cost]);
        write!(f, "{facts}")?;
        let mut sources = Table::new(&["", ""]);
        for s in &self.sources {
            sources.row([s.name.as_str(), &s.report.replace("\n  ", "\n")]);
            if s.used < s.rows && !s.report.contains("left out") {
                let skipped = s.skipped.iter().map(|(reason, count)| format!("left out {count}: {reason}"));
                skipped.for_each(|line| sources.row(["", &line]));
            }
        }
        section(f, "Sources", &sources)?;
        sensors(f, &self.sensors)?;
        refusals(f, &self.sensors)?;
        innovations(f, &self.sensors)?;
        if let Some(score) = &self.score {
            errors(f, score)?;
            drifts(f, score)?;
        }
        parameters(f, &self.parameters)
    }
}

fn section(f: &mut fmt::Formatter<'_>, title: &str, table: &Table) -> fmt::Result {
    if table.is_empty() {
        Ok(())
    } else {
        write!(f, "\n{title}\n{table}")
    }
}

fn band(c: &Consistency) -> String {
    format!("{} … {}", number(c.band.0), number(c.band.1))
}

fn sensors(f: &mut fmt::Formatter<'_>, tallies: &[SensorTally]) -> fmt::Result {
    let counts = counts(tallies);
    let titles: Vec<String> = counts.iter().map(|(title, _)| format!(">{title}")).collect();
    let titles = [""]
        .into_iter()
        .chain(titles.iter().map(String::as_str))
        .chain([">mean NIS", ">dof", ">95 % band", ""]);
    let mut t = Table::new(&titles.collect::<Vec<_>>());
    for s in tallies {
        let mut cells = vec![s.name.clone()];
        cells.extend(counts.iter().map(|(_, count)| count_cell(count(s))));
        if let Some(c) = &s.nis {
            cells.extend([number(c.mean), c.dof.to_string(), band(c), c.word().to_owned()]);
        }
        t.row(cells);
    }
    section(f, "Sensors", &t)
}

fn refusals(f: &mut fmt::Formatter<'_>, tallies: &[SensorTally]) -> fmt::Result {
    let mut t = Table::new(&["", ">rejected in a row", ">from [s]", ">for [s]", ""]);
    for s in tallies {
        if let Some(r) = &s.longest_refusal {
            let end = if s.ends_denied { "denied at the end" } else { "" };
            let [from, seconds] = [r.from, r.seconds].map(|v| format!("{v:.1}"));
            t.row([s.name.clone(), r.measurements.to_string(), from, seconds, end.to_owned()]);
        }
    }
    section(f, "Longest refusals", &t)
}

fn innovations(f: &mut fmt::Formatter<'_>, tallies: &[SensorTally]) -> fmt::Result {
    let mut t = Table::new(&["", ">RMS", ">max"]);
    for s in tallies.iter().filter(|s| s.innovations.count > 0) {
        for (k, (row, factor)) in residual_rows(s).into_iter().enumerate() {
            let (rms, max) = (s.innovations.rms[k] * factor, s.innovations.max[k] * factor);
            t.row([format!("{} {row}", s.name), number(rms), number(max)]);
        }
    }
    section(f, "Innovations of accepted measurements", &t)
}

fn errors(f: &mut fmt::Formatter<'_>, score: &Score) -> fmt::Result {
    let mut t = Table::new(&["", ">RMS", ">mean", ">max", ">mean 3σ", ">inside 3σ"]);
    let mut add = |axes: &Option<Axes>, what: &str, names: [&str; 3], unit: &str| {
        let Some(a) = axes else { return };
        for (k, name) in names.into_iter().enumerate() {
            let places = decimals(a.rms[k].max(1e-3));
            let inside = format!("{:.1} %", 100.0 * a.inside[k]);
            let cells = [a.rms[k], a.mean[k], a.max[k], a.three_sigma[k]].map(|v| fixed(v, places));
            t.row([format!("{what} {name} [{unit}]")].into_iter().chain(cells).chain([inside]));
        }
    };
    const NED: [&str; 3] = ["north", "east", "down"];
    add(&score.position, "position", NED, "m");
    add(&score.velocity, "velocity", NED, "m/s");
    add(&score.attitude_deg, "attitude", ["roll", "pitch", "yaw"], "deg");
    if t.is_empty() {
        return write!(f, "\nErrors\n  no epoch of the reference lies within the run\n");
    }
    section(f, &format!("Errors against the reference, {} epochs", score.epochs), &t)?;
    if score.position.is_some() {
        writeln!(
            f,
            "  horizontal RMS {} m, max {} m",
            number(score.horizontal_rms),
            number(score.horizontal_max)
        )?;
    }
    if let Some(m) = &score.mounting_deg {
        writeln!(
            f,
            "  mean mounting taken out: roll {}, pitch {}, yaw {} deg",
            number(m[0]),
            number(m[1]),
            number(m[2])
        )?;
    }
    if let (Some(heading), Some(inclination)) = (score.heading_rmse_deg, score.inclination_rmse_deg) {
        writeln!(
            f,
            "  rotation error: heading RMSE {} deg, inclination RMSE {} deg",
            number(heading),
            number(inclination)
        )?;
    }
    let nees = [
        ("position", &score.nees_position),
        ("velocity", &score.nees_velocity),
        ("attitude", &score.nees_attitude),
    ];
    for (what, c) in nees {
        if let Some(c) = c {
            writeln!(
                f,
                "  NEES of {what} {}, {} dof, 95 % band {}: {}",
                number(c.mean),
                c.dof,
                band(c),
                c.word()
            )?;
        }
    }
    Ok(())
}

fn drifts(f: &mut fmt::Formatter<'_>, score: &Score) -> fmt::Result {
    let mut t = Table::new(&[">from [s]", ">to [s]", ">max horizontal error [m]", ">growth [m]"]);
    for Drift {
        from,
        to,
        max_horizontal,
        growth,
    } in score.drift.iter().take(OUTAGES)
    {
        t.row([format!("{from:.1}"), format!("{to:.1}"), number(*max_horizontal), number(*growth)]);
    }
    section(f, "Drift in outages", &t)?;
    if score.drift.len() > OUTAGES {
        writeln!(f, "  … and {} more, all of them in summary.json", score.drift.len() - OUTAGES)?;
    }
    if let (Some(rms), Some(median)) = (score.drift_rms, score.drift_median) {
        let count = score.drift.len();
        writeln!(
            f,
            "  RMS {} m, median {} m over {count} outage{}",
            number(rms),
            number(median),
            if count == 1 { "" } else { "s" }
        )?;
    }
    Ok(())
}

fn parameters(f: &mut fmt::Formatter<'_>, states: &[FinalState]) -> fmt::Result {
    let mut t = Table::new(&["", ">value", "", ">1σ", "unit"]);
    for state in states {
        let (factor, unit) = readable(state.unit);
        // A rotation is stored as a quaternion and read as roll, pitch, yaw.
        let is_rotation = state.value.len() == 4 && state.sigma.len() == 3;
        let values: Vec<f64> = if is_rotation {
            so3::to_rpy(&Attitude::read(&state.value)).as_slice().to_vec()
        } else {
            state.value.clone()
        };
        for (k, value) in values.iter().enumerate() {
            let axis = match (values.len(), is_rotation) {
                (1, _) => String::new(),
                (_, true) => format!(" {}", ["roll", "pitch", "yaw"][k]),
                (3, _) => format!(" {}", ["x", "y", "z"][k]),
                _ => format!(" {k}"),
            };
            let sigma = state.sigma.get(k).copied().unwrap_or(f64::NAN) * factor;
            t.row([
                format!("{}{axis}", state.name),
                number(value * factor),
                "±".to_owned(),
                number(sigma),
                unit.clone(),
            ]);
        }
    }
    section(f, "Estimated parameters at the end", &t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_above_its_band_is_optimistic() {
        let c = |mean| Consistency {
            mean,
            dof: 3,
            count: 100,
            independent: 100.0,
            band: (2.5, 3.5),
        };
        assert_eq!([3.6, 3.0, 2.4].map(|m| c(m).word()), ["optimistic", "consistent", "pessimistic"]);
    }

    #[test]
    fn a_run_that_never_started_says_what_it_waits_for() {
        let summary = Summary {
            waiting: vec![("fix".to_owned(), "a position".to_owned())],
            ..Summary::default()
        };
        assert_eq!(summary.warnings(), ["the filter never started: `fix` waits for a position"]);
        assert!(
            summary
                .to_string()
                .contains("  started  never\n           `fix` waits for a position\n"),
            "{summary}"
        );
    }
}
