//! The result of a Monte Carlo campaign.

use super::control;
use super::judged::{NEES, axis_name, consistency, is_judged_as_block};
use super::run::{NED, RPY};
use super::sensors::{count_columns, counts, residual_rows, row_name, sum};
use crate::Shown;
use fusion::health::State;
use fusion::score::{Consistency, ConsistencyVerdict};
use fusion_judge::campaign::{Campaign, Compared, Duel, Figure, Independence, Pace, Pooled, SensorTally, Statistic};
use fusion_tables::Unit;
use fusion_tables::significant;
use fusion_tables::{Cell, Column, Page, Section, Table};

/// Outages listed one by one.
const OUTAGES: usize = 40;

/// The figures of campaigns over all their times and runs, a row for each with its name.
#[must_use]
pub fn pooled(campaigns: &[(&str, &Campaign)]) -> Section {
    let deg = |name: &str| Column::with_unit(name, Unit::shown("deg"));
    let columns = [
        Column::text("run"),
        Column::number("converged"),
        Column::with_unit("after", Unit::of_si("s")),
        deg("attitude RMSE"),
        Column::with_unit("position RMSE", Unit::shown("m")),
        Column::number("NEES/n attitude"),
        Column::number("NEES/n velocity"),
        Column::number("NEES/n position"),
        Column::number("outside episodes"),
        Column::with_unit("drift in outages", Unit::of_si("m")),
        Column::with_unit("drift", Unit::shown("% of way")),
        Column::text("first is better in"),
    ];
    let mut t = Table::new(columns);
    let first = campaigns.first().map(|(_, first)| *first);
    for (name, campaign) in campaigns {
        let Pooled {
            attitude,
            position,
            nees: [of_position, of_velocity, of_attitude],
            drift_percent,
            drift,
            converged,
            after,
        } = campaign.pooled();
        let cells = [attitude, position, of_attitude, of_velocity, of_position].map(Cell::real);
        let convergence = [converged.map_or(Cell::Empty, Cell::Share), after.map_or(Cell::Empty, Cell::Seconds)];
        let apart = campaign.judge(Statistic::Episodes(1, 0));
        let apart = Cell::real(apart.map(|c| c.mean / c.dof as f64));
        let others = first.filter(|first| !core::ptr::eq(*first, *campaign));
        let wins = others.and_then(|first| first.against(campaign, Compared::Position));
        let wins = wins.map_or(Cell::Empty, |duel| Cell::text(format!("{} of {}", duel.better, duel.runs)));
        t.row(
            [Cell::text(*name)]
                .into_iter()
                .chain(convergence)
                .chain(cells)
                .chain([apart])
                .chain([drift, drift_percent].map(Cell::real))
                .chain([wins]),
        );
    }
    let section = Section::new(
        "Over all times and runs: RMS of the whole error, NEES over its dimension (1 is expected)",
        [t],
    );
    let others = campaigns.iter().skip(1);
    let verdicts = campaigns
        .first()
        .map(|first| others.filter_map(|other| verdict(first, other)).collect());
    Section {
        notes: verdicts.unwrap_or_default(),
        ..section
    }
}

/// In how many runs a campaign is better than the first, and whether chance would do the same; nothing of runs that are
/// not independent.
fn verdict((first_name, first): &(&str, &Campaign), (name, other): &(&str, &Campaign)) -> Option<String> {
    let are_worlds = [first, other].iter().all(|c| c.independence() == Independence::Full);
    let errors = [
        ("position", Compared::Position),
        ("attitude", Compared::Attitude),
        ("velocity", Compared::Velocity),
    ];
    let duels = errors
        .into_iter()
        .filter_map(|(what, error)| Some((what, other.against(first, error)?)));
    let all: Vec<String> = duels.map(|(what, duel)| said(what, &duel)).collect();
    (are_worlds && !all.is_empty()).then(|| format!("{name} against {first_name}: {}.", all.join("; ")))
}

/// `position better in 19 of 20 runs (95 %: 76 to 99 %)`.
fn said(what: &str, duel: &Duel) -> String {
    let Some((low, high)) = duel.interval() else {
        return format!("{what} the same in all {} runs", duel.runs);
    };
    let is_chance = if low <= 0.5 && high >= 0.5 { ", not significant" } else { "" };
    format!(
        "{what} better in {} of {} runs (95 %: {:.0} to {:.0} %{is_chance})",
        duel.better,
        duel.runs,
        100.0 * low,
        100.0 * high
    )
}

/// How many runs of each campaign were in which health at worst, and which of them were lost.
#[must_use]
pub fn health(campaigns: &[(&str, &Campaign)]) -> Section {
    let states = State::ALL.map(|s| Column::number(s.word()));
    let shares = ["ill, mean", "ill, most"].map(Column::number);
    let mut t = Table::new([Column::text("run")].into_iter().chain(states).chain(shares));
    for (name, campaign) in campaigns {
        let counts = State::ALL.map(|s| Cell::from(campaign.with_worst(s)));
        let ill = campaign.spread(Figure::Ill);
        let shares = [ill.map(|s| s.mean), ill.map(|s| s.max)].map(|s| s.map_or(Cell::Empty, Cell::Share));
        t.row([Cell::text(*name)].into_iter().chain(counts).chain(shares));
    }
    let section = Section::new(
        "Health: runs by their worst state after aligning; ill: share of the time coasting or worse",
        [t],
    );
    let declared = campaigns.iter().map(|(name, c)| (name, c.as_declared, c.runs));
    let notes = declared
        .filter(|(_, n, _)| *n > 0)
        .map(|(name, n, all)| format!("{name}: degraded or lost in declared outages alone, or just after them, in {n} of {all} runs."));
    Section {
        notes: notes.collect(),
        ..section
    }
}

/// A description as the beginning of a title.
fn titled(description: &str) -> String {
    if description.is_empty() {
        String::new()
    } else {
        format!("{description}: ")
    }
}

/// `672,000 filter epochs in 0.61 s: 1.10 M/s on 2 threads`.
fn pace(pace: &Pace) -> String {
    let Pace { epochs, seconds, threads } = *pace;
    let millions = pace.per_second() * 1e-6;
    let threads = format!("{threads} thread{}", if threads == 1 { "" } else { "s" });
    format!(
        "{} filter epochs in {seconds:.2} s: {millions:.2} M/s on {threads}",
        grouped(epochs)
    )
}

/// With a comma before every three digits.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut shown = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            shown.push(',');
        }
        shown.push(digit);
    }
    shown
}

impl Shown<'_, Campaign> {
    /// The page: spreads per axis, consistency, the outcomes of the gates, innovations.
    #[must_use]
    pub fn page(&self) -> Page {
        Page {
            title: format!("{}{} runs", titled(&self.subject.description), self.runs + self.failed),
            provenance: self.subject.provenance.clone(),
            warnings: self.warnings(),
            sections: self
                .verdict()
                .map(|verdict| Section::new("", []).note(verdict))
                .into_iter()
                .chain([self.failures(), pooled(&[("all runs", self)]), health(&[("all runs", self)])])
                .chain([Section::new("Errors over the runs", [self.errors()]), self.drift()])
                .chain(control::spread(self))
                .chain([
                    Section::new(
                        "Estimated parameters against the truth, at the end of the runs",
                        [self.parameters()],
                    ),
                    self.consistency(),
                    Section::new("Sensors, counts over all runs", [self.gates()]),
                    Section::new("Innovations of accepted measurements, over the runs", [self.innovations()]),
                    self.look_next(),
                    Section::new("", []).note(pace(&self.pace)),
                ])
                .collect(),
        }
    }

    /// The first failed runs, with their reasons.
    fn failures(&self) -> Section {
        let mut t = Table::new([Column::number("run"), Column::number("seed"), Column::text("reason")]);
        let failures = self.0.failures();
        for run in failures {
            t.row([
                Cell::text(run.run.to_string()),
                Cell::text(run.seed.to_string()),
                Cell::text(&*run.reason),
            ]);
        }
        let section = Section::new("Failed runs, which have no part in the figures", [t]);
        match self.failed - failures.len() {
            0 => section,
            more => section.note(format!("And {more} more: the column `error` of runs.csv has their reasons.")),
        }
    }

    /// The number of runs that failed, and how to look at one.
    fn failed(&self) -> Option<String> {
        let first = self.0.failures().first()?;
        let all = self.failed + self.runs;
        Some(format!(
            "{} of {all} runs failed; repeat the first one with `fusion run … --seed {}`: {}",
            self.failed, first.seed, first.reason
        ))
    }

    /// The findings to look at next: those of the median run that at least half of the runs have too.
    fn look_next(&self) -> Section {
        let ((seed, found), all) = (self.findings(), self.runs);
        let Some(seed) = seed.filter(|_| !found.is_empty()) else {
            return Section::default();
        };
        let mut section = Section::new("Look at next", []).note(format!(
            "Said by the run in the middle, `fusion run … --seed {seed}`, whose figures they are, and by at least half of the runs:"
        ));
        let lines = found
            .iter()
            .map(|(finding, runs)| format!("- {finding} ({runs} of {all} runs). [{}]", finding.rule));
        section.notes.extend(lines);
        section
    }

    /// The warnings about all runs together that a reader must not overlook.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let shared = match self.independence() {
            Independence::Full => None,
            Independence::SharedLog => {
                Some("the runs share one recorded log and differ by their random faults alone: bands are those of one run".to_owned())
            }
            Independence::Identical => Some(format!(
                "nothing in this design is random: all {} runs are the same, and count as one",
                self.runs
            )),
        };
        self.failed()
            .into_iter()
            .chain(shared)
            .chain(self.ill())
            .chain(self.spikes())
            .collect()
    }

    /// In how many runs samples of the input were taken for spikes.
    fn spikes(&self) -> Option<String> {
        let (runs, all) = self.spikes;
        let nees: Vec<Consistency> = (0..3).filter_map(|i| self.judge(Statistic::Nees(i))).collect();
        // Where errors are as the filter says, they did no harm.
        let is_harmful = nees.is_empty() || nees.iter().any(|c| c.verdict() == Some(ConsistencyVerdict::Overconfident));
        (runs > 0 && is_harmful).then(|| {
            format!(
                "in {runs} of {} runs samples of the process input were taken for spikes and not used, {} in a run on average: \
                 the vehicle moves faster than `process.agility` says, unless they are faults that are declared",
                self.runs,
                significant(all as f64 / runs as f64)
            )
        })
    }

    /// The number of runs in which the filter was degraded, lost, or never good, and how to look at one of the worst.
    fn ill(&self) -> Option<String> {
        let kinds = [
            (State::Lost, "lost"),
            (State::Degraded, "degraded"),
            (State::Aligning, "never aligned"),
        ];
        let counts = kinds.map(|(state, word)| (self.undeclared(state).runs, word));
        let told: Vec<String> = counts
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, word)| format!("{word} in {n}"))
            .collect();
        let (worst, word) = kinds.into_iter().find(|(state, _)| self.undeclared(*state).runs > 0)?;
        let worst = self.undeclared(worst);
        let seeds: Vec<String> = worst.seeds.iter().map(u64::to_string).collect();
        let more = match worst.runs - seeds.len() {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        Some(format!(
            "health: of {} runs the filter was {}; repeat one that was {word} with `fusion run … --seed SEED`: {}{more}",
            self.runs,
            told.join(", "),
            seeds.join(", ")
        ))
    }

    /// A sentence: whether the errors of the runs are consistent with the covariance of the filter. Without a reference
    /// it is judged by NIS. `None` if nothing can be judged.
    fn verdict(&self) -> Option<String> {
        let nees = ["position", "velocity", "attitude"].into_iter().enumerate();
        let nees: Vec<_> = nees.filter_map(|(i, of)| Some((of, self.judge(Statistic::Nees(i))?))).collect();
        let nis = self.sensors().iter().enumerate();
        let nis = nis.filter_map(|(i, s)| Some((s.all.name.as_str(), self.judge(Statistic::Nis(i))?)));
        let (what, judged): (_, Vec<_>) = if nees.is_empty() { ("NIS", nis.collect()) } else { ("NEES", nees) };
        let count = judged.iter().filter(|(_, c)| c.verdict().is_some()).count();
        let judged = judged.into_iter().map(|(of, c)| (of, c.among(count)));
        let known: Vec<(&str, Consistency, ConsistencyVerdict)> = judged.filter_map(|(of, c)| Some((of, c, c.verdict()?))).collect();
        let words = |(of, c, verdict): &(&str, Consistency, ConsistencyVerdict)| {
            let [mean, low, high] = [c.mean, c.band.0, c.band.1].map(|v| significant(v / c.dof as f64));
            let side = if *verdict == ConsistencyVerdict::Consistent {
                "in"
            } else {
                "outside"
            };
            let told = if *verdict == ConsistencyVerdict::Consistent {
                String::new()
            } else {
                format!(" ({}: errors are {} times its 1σ)", verdict.word(), significant(c.error_ratio()))
            };
            format!("{of} {mean} {side} {low} … {high}{told}")
        };
        let is_consistent = |(.., verdict): &&(&str, Consistency, ConsistencyVerdict)| *verdict == ConsistencyVerdict::Consistent;
        let wrong: Vec<_> = known.iter().filter(|k| !is_consistent(k)).collect();
        let is_all = |verdict: ConsistencyVerdict| wrong.iter().all(|k| k.2 == verdict);
        let (head, told) = match (known.is_empty(), wrong.is_empty()) {
            (true, _) => return None,
            (_, true) => ("Consistent", known.iter().collect()),
            _ if is_all(ConsistencyVerdict::Overconfident) => ("Overconfident", wrong),
            _ if is_all(ConsistencyVerdict::Conservative) => ("Conservative", wrong),
            _ => ("Not consistent", wrong),
        };
        let told: Vec<String> = told.into_iter().map(words).collect();
        let same = if self.independence() == Independence::Identical {
            " that are all the same"
        } else {
            ""
        };
        Some(format!(
            "{head} over {} runs{same}: {what} over its degrees of freedom, of {}.",
            self.runs,
            told.join("; of ")
        ))
    }

    /// The final errors of each parameter with a drawn truth, and the 1σ that the filter gives for them.
    fn parameters(&self) -> Table {
        let numbers = ["RMS", "mean 1σ", "inside 3σ"].map(Column::number);
        let mut t = Table::new([Column::text("parameter")].into_iter().chain(numbers));
        for (i, block) in self.blocks().iter().enumerate().filter(|(_, b)| b.is_parameter) {
            for k in 0..block.error.len() {
                let [rms, sigma, inside] = self.ends()[i][k].figures();
                let cells = [Cell::Real(rms), Cell::Real(sigma), Cell::Share(inside)];
                t.row_in(Unit::of_si(&block.unit), [Cell::text(axis_name(block, k))].into_iter().chain(cells));
            }
        }
        t
    }

    fn errors(&self) -> Table {
        type OfAxis = fn(usize) -> Figure;
        let groups: [(&str, &str, OfAxis, [&str; 3]); 4] = [
            ("position RMS", "m", Figure::Rms, NED),
            ("position max", "m", Figure::Max, NED),
            ("velocity RMS", "m/s", Figure::VelocityRms, NED),
            ("attitude RMS", "deg", Figure::AttitudeRms, RPY),
        ];
        let numbers = ["mean", "standard deviation", "min", "max"].map(Column::number);
        let mut t = Table::new([Column::text("error")].into_iter().chain(numbers));
        for (name, unit, figure, axes) in groups {
            for (i, axis) in axes.iter().enumerate() {
                if let Some(s) = self.spread(figure(i)) {
                    let cells = [s.mean, s.std, s.min, s.max].map(Cell::Real);
                    let name = Cell::text(format!("{name} {axis}"));
                    t.row_in(Unit::shown(unit), [name].into_iter().chain(cells));
                }
            }
        }
        let drifts = [
            ("drift in outages", "m", Figure::Drift),
            ("drift", "% of the way", Figure::DriftPercent),
        ];
        for (name, unit, figure) in drifts {
            if let Some(s) = self.spread(figure) {
                let cells = [s.mean, s.std, s.min, s.max].map(Cell::Real);
                t.row_in(Unit::shown(unit), [Cell::text(name)].into_iter().chain(cells));
            }
        }
        t
    }

    /// Each declared outage over the runs: the error at its end, and the σ that the filter gives for it.
    fn drift(&self) -> Section {
        let metres = |name: &str| Column::with_unit(name, Unit::of_si("m"));
        let seconds = |name: &str| Column::with_unit(name, Unit::of_si("s"));
        let columns = [
            seconds("from"),
            seconds("to"),
            Column::number("runs"),
            metres("at the end, RMS"),
            metres("max"),
            metres("mean 3σ there"),
            Column::number("error/σ, RMS"),
            Column::number("inside 3σ"),
        ];
        let mut t = Table::new(columns);
        let outages = self.outages();
        for outage in outages.iter().take(OUTAGES) {
            let [rms, max, sigma, ratio, inside] = outage.figures();
            let errors = [rms, max, sigma, ratio];
            let times = [outage.from, outage.to].map(Cell::Seconds);
            t.row(
                times
                    .into_iter()
                    .chain([Cell::from(outage.runs)])
                    .chain(errors.map(Cell::Real))
                    .chain([Cell::Share(inside)]),
            );
        }
        let section = Section::new("Drift in outages, over the runs", [t]);
        match outages.len() {
            0 => section,
            n if n > OUTAGES => section.note(format!("The first {OUTAGES} of {n} outages are listed.")),
            _ => section.note(
                "At the end: the horizontal error at the last epoch of the outage, its 3σ in its own direction, and how many σ it is: \
                 of a consistent filter between 1 and 1.4 by the RMS.",
            ),
        }
    }

    fn consistency(&self) -> Section {
        let nees = NEES.into_iter().enumerate();
        let nees = nees.map(|(i, name)| (name.to_owned(), self.judge(Statistic::Nees(i))));
        let apart = [0, 1].into_iter().flat_map(|part| {
            let name = ["during", "outside"][part];
            let all = NEES.into_iter().enumerate();
            all.map(move |(i, nees)| (format!("{nees}, {name} episodes"), self.judge(Statistic::Episodes(part, i))))
        });
        let blocks = self.blocks().iter().enumerate().filter(|(_, b)| is_judged_as_block(b));
        let blocks = blocks.map(|(i, b)| (format!("NEES {}", b.name), self.judge(Statistic::Block(i))));
        let nis = self.sensors().iter().enumerate();
        let nis = nis.map(|(i, s)| (format!("NIS {}", s.all.name), self.judge(Statistic::Nis(i))));
        let judged: Vec<_> = nees
            .chain(apart)
            .chain(blocks)
            .chain(nis)
            .filter_map(|(name, c)| Some((name, c?)))
            .collect();
        consistency(judged.iter().map(|(name, c)| (name.clone(), c)))
    }

    /// Counts summed over the runs, and the longest rejection streaks.
    fn gates(&self) -> Table {
        let counts = counts(self.sensors().iter().map(|sensor| &sensor.all));
        let streaks = [
            Column::number("longest streak"),
            Column::with_unit("lasting", Unit::of_si("s")),
            Column::number("end denied"),
        ];
        let columns = [Column::text("sensor")].into_iter().chain(count_columns(&counts));
        let mut t = Table::new(columns.chain(streaks));
        for SensorTally { all, denied } in self.sensors() {
            let mut cells = vec![Cell::text(&all.name)];
            cells.extend(counts.iter().map(|(_, count)| sum([all], *count)));
            if let Some(most) = all.longest_rejection_streak {
                cells.extend([Cell::Count(most.measurements), Cell::Seconds(most.seconds), Cell::from(*denied)]);
            }
            t.row(cells);
        }
        t
    }

    /// RMS and maximum of the innovations, over the runs that have any.
    fn innovations(&self) -> Table {
        let columns = ["mean RMS", "mean max", "largest max"].map(Column::number);
        let mut t = Table::new([Column::text("residual")].into_iter().chain(columns));
        for (i, SensorTally { all: sensor, .. }) in self.sensors().iter().enumerate() {
            for (k, (row, unit)) in residual_rows(sensor).into_iter().enumerate() {
                let spreads = [Figure::InnovationRms(i, k), Figure::InnovationMax(i, k)].map(|figure| self.spread(figure));
                if let [Some(rms), Some(max)] = spreads {
                    let cells = [rms.mean, max.mean, max.max].map(Cell::Real);
                    t.row_in(unit, [row_name(sensor, &row)].into_iter().chain(cells));
                }
            }
        }
        t
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_that_chance_makes_is_not_significant() {
        let of = |better, worse| {
            let duel = Duel { better, worse, runs: 20 };
            said("position", &duel)
        };
        // Wilson's interval of 19 in 20 is 0.764 to 0.991, of 12 in 20 0.387 to 0.781.
        assert_eq!(of(19, 1), "position better in 19 of 20 runs (95 %: 76 to 99 %)");
        assert_eq!(of(12, 8), "position better in 12 of 20 runs (95 %: 39 to 78 %, not significant)");
        assert_eq!(of(0, 0), "position the same in all 20 runs");
    }

    #[test]
    fn the_pace_is_one_line() {
        let of = |epochs, seconds, threads| pace(&Pace { epochs, seconds, threads });
        assert_eq!(of(672_000, 0.61, 2), "672,000 filter epochs in 0.61 s: 1.10 M/s on 2 threads");
        assert_eq!(of(12, 2.0, 1), "12 filter epochs in 2.00 s: 0.00 M/s on 1 thread");
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }
}
