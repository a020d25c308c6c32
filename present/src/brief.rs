//! The main results of a run: a page that fits on a screen.

use super::control;
use super::health;
use super::run::{RPY, converged};
use super::sensors::{count_columns, counted, counts};
use crate::Shown;
use fusion::run::Summary;
use fusion::score::{Axes, Consistency, ConsistencyVerdict, Drift, Score};
use fusion_core::math;
use fusion_tables::short;
use fusion_tables::{Cell, Column, Page, Section, Table};

/// Findings that are shown; all of them are with the other tables.
const FINDINGS: usize = 4;

impl Shown<'_, Summary> {
    /// Health, errors, consistency and the findings to look at next, then the outcomes of the measurements. For most
    /// designs it fits on a screen. [`page`](Self::page) has everything.
    #[must_use]
    pub fn brief(&self) -> Page {
        Page {
            title: self.identity().description.clone(),
            provenance: self.identity().provenance.clone(),
            warnings: self.warnings(),
            sections: [self.verdict(), self.look_next(FINDINGS), health::section(self.health())]
                .into_iter()
                .chain(control::section(self.control()))
                .chain([self.sensors_in_short()])
                .chain(crate::section::brief(self))
                .collect(),
        }
    }

    /// Health, errors and consistency, a line each.
    #[must_use]
    pub fn verdict(&self) -> Section {
        let mut t = Table::list();
        for health in self.health() {
            let name = match health.filter.as_str() {
                "" => "health".to_owned(),
                filter => format!("health of `{filter}`"),
            };
            t.row([name, health::line(health)]);
            if let Some(first) = health::first_ill(health) {
                t.row(["".to_owned(), first]);
            }
        }
        match (self.start().started, self.late_start()) {
            (None, _) => t.row(["started", "never"]),
            (Some(at), Some(wait)) => t.row(["started", &format!("at {at:.1} s: {}", wait)]),
            _ => {}
        }
        for (name, what) in &self.start().waiting {
            t.row(["", &format!("`{name}` waits for {what}")]);
        }
        let smoothed = self.smoothed().and_then(|s| s.score.as_ref());
        match self.score() {
            Some(score) if score.epochs > 0 => {
                errors(&mut t, "", score);
                if let Some(line) = self.while_aligning(score) {
                    t.row(["", &line]);
                }
                smoothed.into_iter().for_each(|score| errors(&mut t, "smoothed ", score));
                if let Some(source) = &self.judge().source {
                    let by = if self.judge().used_rows {
                        format!(
                            "rows of `{source}` that the filter uses: these figures say how closely it follows them, not how right it is \
                             (`keep` of the sources divides them)"
                        )
                    } else {
                        format!("other rows of `{source}`: errors that last are in both, and not in these figures")
                    };
                    t.row(["judged by", &by]);
                }
            }
            Some(_) => t.row(["reference", "none of its epochs lies within the run"]),
            None if self.start().started.is_some() => {
                t.row(["errors", "no reference: judged by innovations alone"]);
                if let Some(line) = self.innovations_in_short() {
                    t.row(["NIS over expected", &line]);
                }
            }
            None => {}
        }
        Section::new("", [t])
    }

    /// A note if the largest heading error is from the time before the filter was aligned.
    fn while_aligning(&self, score: &Score) -> Option<String> {
        let aligned = self.health().iter().find(|h| h.filter.is_empty())?.aligned?;
        let (at, most) = score.attitude_deg.as_ref().map(|axes| (axes.max_time[2], axes.max[2]))?;
        (at < aligned).then(|| {
            format!(
                "its largest heading error, {}° at {at:.1} s, is of the time before the filter was aligned, at {aligned:.1} s, which counts in \
                 these figures: `[reference] from = \"{aligned:.1} s\"` leaves it out",
                short(most)
            )
        })
    }

    /// The findings to look at next, at most `most` of them.
    #[must_use]
    pub fn look_next(&self, most: usize) -> Section {
        let mut section = Section::new("Look at next", []);
        section.notes = self.findings().iter().take(most).map(|f| format!("- {f}. [{}]", f.rule)).collect();
        if self.findings().len() > most {
            section.notes.push(format!("… and {} more.", self.findings().len() - most));
        }
        if section.notes.is_empty() { Section::default() } else { section }
    }

    /// `gnss 0.95, compass 1.1`.
    fn innovations_in_short(&self) -> Option<String> {
        let nis = self.sensors().iter().filter_map(|s| Some((&s.name, s.nis.as_ref()?)));
        let shown: Vec<String> = nis.map(|(name, c)| format!("`{name}` {}", short(c.over_expected()))).collect();
        (!shown.is_empty()).then(|| shown.join(", "))
    }

    /// Counts and NIS of each sensor.
    fn sensors_in_short(&self) -> Section {
        let counts = counts(self.sensors());
        let nis = Column::number("NIS over expected");
        let mut t = Table::new([Column::text("sensor")].into_iter().chain(count_columns(&counts)).chain([nis]));
        for s in self.sensors() {
            let cells = counts.iter().map(|(_, count)| Cell::count(count(s)));
            let nis = Cell::real(s.nis.as_ref().map(Consistency::over_expected));
            t.row([Cell::text(&s.name)].into_iter().chain(cells).chain([nis]));
        }
        counted(Section::new("Sensors", [t]), &counts)
    }
}

/// A line for each of position, velocity and attitude, drift and convergence.
fn errors(t: &mut Table, whose: &str, score: &Score) {
    let mut line = |name: &str, parts: Vec<String>, nees: Option<&Consistency>| {
        let parts = parts.into_iter().chain(nees.map(said)).collect::<Vec<_>>();
        t.row([format!("{whose}{name}"), parts.join("; ")]);
    };
    if let Some(position) = &score.position {
        let mut horizontal = format!("horizontal {} m RMS", short(score.horizontal_rms));
        let more = [
            ("median", score.horizontal_median),
            ("95 %", score.horizontal_p95),
            ("max", Some(score.horizontal_max)),
        ];
        for (name, value) in more {
            horizontal.extend(value.map(|value| format!(", {name} {}", short(value))));
        }
        let down = Some(position.rms[2]).filter(|down| down.is_finite());
        let down = down.map(|down| format!("down {} m", short(down)));
        line(
            "position",
            [horizontal].into_iter().chain(down).collect(),
            score.nees_position.as_ref(),
        );
    }
    let length = |axes: &Axes| math::sqrt(axes.rms.iter().map(|v| v * v).sum::<f64>());
    if let Some(velocity) = &score.velocity {
        line(
            "velocity",
            vec![format!("{} m/s RMS", short(length(velocity)))],
            score.nees_velocity.as_ref(),
        );
    }
    if let Some(attitude) = &score.attitude_deg {
        let of = |name: &str, value: Option<f64>| value.map(|v| format!("{name} {}°", short(v)));
        let parts = [of("heading", score.heading_rmse_deg), of("tilt", score.inclination_rmse_deg)];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let inside = score.nees_attitude.is_none().then(|| inside(attitude)).flatten();
        let parts = [format!("{} RMS", parts.join(", "))].into_iter().chain(inside);
        line("attitude", parts.collect(), score.nees_attitude.as_ref());
    }
    if let (Some(rms), Some(median)) = (score.drift_rms, score.drift_median) {
        let drift = match score.drift.len() {
            1 => format!("1 outage, largest horizontal error {} m", short(rms)),
            n => format!(
                "{n} outages, largest horizontal error {} m RMS, median {}",
                short(rms),
                short(median)
            ),
        };
        let cut = score.drift.iter().filter(|d| d.is_cut).count();
        let cut = (cut > 0).then(|| "the last not over when the run ended".to_owned());
        line("drift", [drift].into_iter().chain(cut).collect(), None);
    }
    // A smoothed error is largest inside an outage: at its end the fixes after it are used.
    if let Some(worst) = Drift::worst(&score.drift).filter(|_| whose.is_empty()) {
        let said = format!(
            "{} s at {:.1} s: {} m at {} (3σ {} m)",
            short(worst.to - worst.from),
            worst.from,
            short(worst.end_horizontal),
            if worst.is_cut { "the end of the run" } else { "its end" },
            short(3.0 * worst.end_sigma)
        );
        line("worst outage", vec![said], None);
    }
    if let Some(convergence) = &score.convergence {
        line("convergence", vec![converged(convergence)], None);
    }
}

/// `inside 3σ 75 % (yaw), overconfident`: the axis of an attitude with the smallest share, for runs without NEES.
fn inside(attitude: &Axes) -> Option<String> {
    let known = (0..3).filter(|k| attitude.inside[*k].is_finite());
    let k = known.min_by(|a, b| attitude.inside[*a].total_cmp(&attitude.inside[*b]))?;
    let share = attitude.inside[k];
    let verdict = ConsistencyVerdict::of_share(share).filter(|v| *v != ConsistencyVerdict::Consistent);
    let verdict = verdict.map_or(String::new(), |v| format!(", {}", v.word()));
    Some(format!("inside 3σ {:.1} % ({}){verdict}", 100.0 * share, RPY[k]))
}

/// `NEES 13.6 of 3, overconfident`.
fn said(c: &Consistency) -> String {
    let verdict = c.verdict().map_or(String::new(), |verdict| format!(", {}", verdict.word()));
    format!("NEES {} of {}{verdict}", short(c.mean), c.dof)
}
