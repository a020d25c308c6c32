//! The result of one run.

use super::control;
use super::health;
use super::judged::{NEES, axis_name, consistency, is_judged_as_block};
use super::section;
use super::sensors::{count_columns, counted, counts, residual_rows, row_name};
use super::trajectory;
use crate::Shown;
use fusion::observe::{ConsumerCounts, SensorStatistics};
use fusion::run::{Current, FinalState, InsideScore, Smoothed, Summary};
use fusion::score::{Axes, Consistency, ConsistencyVerdict, Convergence, Episodes, Score};
use fusion::solution::rpy_of;
use fusion_core::smoother::Iteration;
use fusion_core::state::{Attitude, Kind, Manifold};
use fusion_tables::Unit;
use fusion_tables::text;
use fusion_tables::{Cell, Column, Page, Section, Table};
use nalgebra::Matrix3;
use std::fmt;

/// Outages listed one by one.
const OUTAGES: usize = 40;
/// Axes of vectors in navigation axes, and of attitudes.
pub(super) const NED: [&str; 3] = ["north", "east", "down"];
/// Axes of attitudes.
pub(super) const RPY: [&str; 3] = ["roll", "pitch", "yaw"];

impl fmt::Display for Shown<'_, Summary> {
    /// As a terminal shows it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&text::page(&self.page(), text::WIDTH))
    }
}

impl Shown<'_, Summary> {
    /// As it is shown.
    #[must_use]
    pub fn page(&self) -> Page {
        Page {
            title: self.identity().description.clone(),
            provenance: self.identity().provenance.clone(),
            warnings: self.warnings(),
            sections: [
                self.verdict(),
                self.look_next(usize::MAX),
                self.facts(),
                health::whole(self.health()),
                self.data(),
            ]
            .into_iter()
            .chain(self.measurements())
            .chain(control::section(self.control()))
            .chain(self.errors())
            .chain([self.estimated()])
            .chain(section::all(self))
            .collect(),
        }
    }

    /// Backend, start, time taken.
    #[must_use]
    pub fn facts(&self) -> Section {
        let mut t = Table::list();
        t.row(["backend", &self.computation().backend]);
        match self.start().started {
            Some(at) => t.row_in(Unit::of_si("s"), [Cell::text("started"), Cell::Fixed(at, 3)]),
            None => t.row(["started", "never"]),
        }
        t.row([Cell::text("epochs"), Cell::Count(self.counts().epochs)]);
        if self.counts().refused_samples > 0 {
            t.row([Cell::text("input samples refused"), Cell::Count(self.counts().refused_samples)]);
        }
        if self.counts().coasted > 0.0 {
            t.row_in(
                Unit::of_si("s"),
                [Cell::text("coasted without input"), Cell::Fixed(self.counts().coasted, 3)],
            );
        }
        if let Some(bank) = self.hypotheses() {
            let each = format!("{} at the end, {} at most", bank.count, bank.most);
            t.row(["hypotheses", &each]);
            t.row([Cell::text("probability of the one shown"), Cell::Ratio(bank.probability)]);
            for change in &bank.changes {
                let by = change
                    .angle
                    .map_or_else(String::new, |angle| format!(", {:.0}° away", angle.to_degrees()));
                t.row(["another one shown", &format!("at {:.1} s{by}", change.time)]);
            }
            if bank.further_changes > 0 {
                t.row(["and later", &format!("{} times more", bank.further_changes)]);
            }
        }
        // Less than a millisecond is rounding of times.
        if self.counts().held_back > 1e-3 {
            let age = [
                Cell::text("age of the estimate, for rows are held back"),
                Cell::Fixed(self.counts().held_back, 3),
            ];
            t.row_in(Unit::of_si("s"), age);
        }
        if let Some(current) = self.current() {
            let Current {
                rewinds,
                rows_again,
                most_rows_again,
                longest_seconds,
                memory,
                ..
            } = current;
            let again = format!("{rewinds} times, {rows_again} rows used again, at most {most_rows_again} at once");
            t.row(["went back", &again]);
            let longest = [
                Cell::text("longest row, with all that it takes"),
                Cell::Fixed(longest_seconds * 1e3, 2),
            ];
            t.row_in(Unit::shown("ms"), longest);
            t.row_in(
                Unit::shown("kB"),
                [Cell::text("kept to go back to"), Cell::Fixed(*memory as f64 * 1e-3, 0)],
            );
        }
        t.row_in(
            Unit::of_si("s"),
            [Cell::text("time taken"), Cell::Fixed(self.effort().wall_seconds, 2)],
        );
        let per_epoch = [Cell::text("filter, per epoch"), Cell::Fixed(self.effort().filter_ns_per_epoch, 0)];
        t.row_in(Unit::shown("ns"), per_epoch);
        Section::new("Run", [t])
    }

    /// The data that the sources delivered.
    #[must_use]
    pub fn data(&self) -> Section {
        let seconds = || Unit::of_si("s");
        let mut t = Table::new([
            Column::text("source"),
            Column::number("rows"),
            Column::number("used"),
            Column::with_unit("span", seconds()),
            Column::with_unit("rate", Unit::shown("Hz")),
            Column::with_unit("longest gap", seconds()),
            Column::with_unit("at", seconds()),
        ]);
        let mut notes = Vec::new();
        for s in self.sources() {
            let r = &s.report;
            let (at, gap) = r.longest_gap.unzip();
            t.row([
                Cell::text(&s.name),
                Cell::Count(s.rows),
                Cell::Count(s.used),
                r.mean_rate().map_or(Cell::Empty, |_| Cell::Seconds(r.span())),
                r.mean_rate().map_or(Cell::Empty, |rate| Cell::Fixed(rate, 3)),
                gap.map_or(Cell::Empty, |gap| Cell::Fixed(gap, 3)),
                at.map_or(Cell::Empty, Cell::time),
            ]);
            for skipped in &r.skipped {
                notes.push(format!("{}: left out {}: {}", s.name, skipped.count, skipped.reason));
                notes.extend(skipped.examples.iter().map(|e| format!("  {} {}: {}", e.counted, e.number, e.what)));
            }
            let disturbed = r.disturbed.iter();
            notes.extend(disturbed.map(|(fault, count)| format!("{}: disturbed {count}: fault {fault}", s.name)));
        }
        Section {
            notes,
            ..Section::new("Sources", [t])
        }
    }

    /// The outcomes of the measurements.
    #[must_use]
    pub fn measurements(&self) -> Vec<Section> {
        let counts = counts(self.sensors());
        let mut table = Table::new([Column::text("sensor")].into_iter().chain(count_columns(&counts)));
        for s in self.sensors() {
            let cells = counts.iter().map(|(_, count)| Cell::count(count(s)));
            table.row([Cell::text(&s.name)].into_iter().chain(cells));
        }
        vec![
            counted(Section::new("Sensors", [table]), &counts),
            Section::new("Rows that were not used", [left_out(self.consumers())]),
            Section::new("Longest rejection streaks", [streaks(self.sensors())]),
            innovations_of(self.sensors()),
        ]
    }

    /// Errors against the reference and consistency.
    #[must_use]
    pub fn errors(&self) -> Vec<Section> {
        let nis = self
            .sensors()
            .iter()
            .filter_map(|s| Some((format!("NIS {}", s.name), s.nis.as_ref()?)));
        let own = self.score().into_iter();
        let of_inside = |inside: &InsideScore| {
            let section = errors(&inside.score);
            Section {
                title: format!("{}, filter `{}`", section.title, inside.filter),
                ..section
            }
        };
        let nees_inside = self.inside().iter().flat_map(|i| nees(&i.score, format!(" {}.", i.filter)));
        let blocks = own.clone().flat_map(|score| &score.blocks).filter(|b| is_judged_as_block(b));
        let of_blocks = blocks.filter_map(|b| Some((format!("NEES {}", b.name), b.nees.as_ref()?)));
        let all_nees = own.clone().flat_map(|score| nees(score, " ".to_owned())).chain(nees_inside);
        let smoothed = self.smoothed().and_then(|s| Some((s, s.score.as_ref()?)));
        let nees_smoothed = smoothed.iter().flat_map(|(_, score)| nees(score, " ".to_owned()));
        let nees_smoothed = nees_smoothed.map(|(name, c)| (format!("{name}, smoothed"), c));
        let mut sections: Vec<Section> = own.clone().map(errors).collect();
        sections.extend(self.current().into_iter().filter_map(|c| c.score.as_ref()).map(current_errors));
        sections.extend(smoothed.map(|(how, score)| smoothed_errors(how, score)));
        let unscored = self.smoothed().filter(|s| s.score.is_none()).and_then(|s| s.iteration);
        sections.extend(unscored.map(|how| Section::new("Smoothed estimates", []).note(iteration(&how))));
        sections.extend(self.inside().iter().map(of_inside));
        sections.extend(own.clone().map(trajectory::section));
        sections.extend(own.clone().filter_map(|score| score.episodes.as_ref()).map(episodes));
        sections.extend(own.clone().map(parameters));
        sections.push(consistency(all_nees.chain(nees_smoothed).chain(of_blocks).chain(nis)));
        sections.extend(own.map(|score| drift(score, smoothed.map(|(_, score)| score))));
        sections
    }

    /// Estimated parameters at the end.
    #[must_use]
    pub fn estimated(&self) -> Section {
        let mut t = Table::new([Column::text("parameter"), Column::number("value"), Column::number("1σ")]);
        let mut notes = Vec::new();
        for state in self.parameters() {
            for (k, (axis, value, sigma)) in axes(state).into_iter().enumerate() {
                let name = format!("{} {axis}", state.name);
                // About an axis that is not estimated only the turns about the others change the angle.
                let is_fixed = state.kind == Kind::Attitude && state.start_sigma.get(k) == Some(&0.0);
                let sigma = if is_fixed { Cell::text("not estimated") } else { Cell::Real(sigma) };
                if is_fixed {
                    notes.push(format!(
                        "`{name}` was declared with a 1σ of 0: its change follows from the turns about the other axes."
                    ));
                }
                t.row_in(Unit::of_si(state.unit), [Cell::text(name.trim_end()), Cell::Real(value), sigma]);
            }
        }
        Section {
            notes,
            ..Section::new("Estimated parameters at the end", [t])
        }
    }

    /// The warnings that a reader must not overlook, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut all = Vec::new();
        if self.start().started.is_none() {
            let waits = self
                .start()
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
        all.extend(health::warnings(self.health()));
        for s in self.sources().iter().filter(|s| s.used == 0) {
            all.push(format!("source `{}` delivered no rows ({} read)", s.name, s.rows));
        }
        for s in self.sensors().iter().filter(|_| self.start().started.is_some()) {
            let (good, bad) = (s.accepted + s.reacquired, s.rejected + s.unusable);
            if good + bad == 0 {
                // A stage may have the name of the sensor that reads it.
                let reads = |stage: &str| self.consumers().iter().any(|c| c.name == s.name && c.stream == stage);
                let detector = self.detectors().iter().find(|d| reads(&d.stage));
                let nearest = detector.and_then(|d| Some(format!(": of `{}` {}", d.stage, d.nearest.as_ref()?)));
                let nearest = nearest.unwrap_or_default();
                all.push(format!("sensor `{}` had no measurement after the start{nearest}", s.name));
            } else if bad > good {
                all.push(format!("sensor `{}`: {bad} of {} measurements were not used", s.name, good + bad));
            }
        }
        all.extend(self.score().into_iter().flat_map(undefined));
        let iteration = self.smoothed().and_then(|s| s.iteration);
        all.extend(iteration.filter(|how| !how.is_converged).map(|how| {
            let distance = how.distance;
            format!("smoothed: the iteration has not converged; it ended {distance:.1e} σ from the optimum")
        }));
        let smoothed = self.smoothed().into_iter().filter_map(|s| s.score.as_ref());
        all.extend(smoothed.flat_map(undefined).map(|warning| format!("smoothed: {warning}")));
        for (consumer, count) in self.unused_rows() {
            let rows = if *count == 1 { "1 row was" } else { &format!("{count} rows were") };
            let (why, is_late) = self.why_unused(consumer);
            let help = if is_late {
                "; a longer `reorder` under [run] accepts later rows"
            } else {
                ""
            };
            all.push(format!("`{consumer}`: {rows} {why}{help}"));
        }
        all.extend(self.failures().first.iter().map(|f| format!("the estimator failed: {f}")));
        if self.failures().further > 0 {
            all.push(format!("the estimator failed {} times more", self.failures().further));
        }
        all
    }
}

impl Shown<'_, Summary> {
    /// Why rows of a consumer were not used, and whether they may have been late.
    fn why_unused(&self, consumer: &str) -> (String, bool) {
        let known = self.consumers().iter().filter(|c| c.name == consumer);
        let reasons = known.flat_map(|c| {
            [
                ("late", c.late),
                ("not finite", c.not_finite),
                ("out of range", c.out_of_range),
                ("spikes", c.spikes),
                ("frozen", c.frozen),
                ("time jumps", c.time_jumps),
                ("otherwise", c.otherwise),
            ]
        });
        let reasons: Vec<(&str, u64)> = reasons.filter(|(_, count)| *count > 0).collect();
        if reasons.is_empty() {
            // Inside a stage they are counted together.
            return ("too late or not finite".to_owned(), true);
        }
        let is_late = reasons.iter().any(|(why, _)| *why == "late");
        let list: Vec<String> = reasons.iter().map(|(why, count)| format!("{count} {why}")).collect();
        (format!("not used ({})", list.join(", ")), is_late)
    }
}

/// Name, value and 1σ of each axis of a parameter, in SI: an attitude as roll, pitch, yaw, a value of a custom manifold
/// as its displacement from the origin of the manifold.
pub(crate) fn axes(state: &FinalState) -> Vec<(String, f64, f64)> {
    if state.kind == Kind::Attitude {
        let q = Attitude::read(&state.value);
        let p = Matrix3::from_row_slice(&state.covariance);
        let (rpy, sigma) = rpy_of(&q, &p);
        return (0..3).map(|k| (RPY[k].to_owned(), rpy[k], sigma[k])).collect();
    }
    let value = match state.kind {
        Kind::Custom(space) => {
            let mut moved = vec![0.0; space.axes.len()];
            state.kind.minus(&state.value, space.origin, &mut moved);
            moved
        }
        _ => state.value.clone(),
    };
    let name = |k: usize| match value.len() {
        1 => String::new(),
        3 => ["x", "y", "z"][k].to_owned(),
        _ => (k + 1).to_string(),
    };
    let sigma = |k: usize| state.sigma.get(k).copied().unwrap_or(f64::NAN);
    let values = value.iter().enumerate();
    values.map(|(k, value)| (name(k), *value, sigma(k))).collect()
}

/// The consumers with rows that were neither used nor judged by a gate. Empty columns and cells are left out.
fn left_out(consumers: &[ConsumerCounts]) -> Table {
    /// Used, rejected and unusable rows are shown with the sensors; rows that were not needed are not a loss.
    const JUDGED: usize = 4;
    let titles = ConsumerCounts::default()
        .outcomes()
        .into_iter()
        .skip(JUDGED)
        .map(|(title, _)| title);
    let columns = [Column::text("consumer"), Column::text("stream"), Column::number("rows")];
    let mut t = Table::new(columns.into_iter().chain(titles.map(Column::number)));
    for c in consumers {
        let counts = || c.outcomes().into_iter().skip(JUDGED).map(|(_, count)| count);
        if counts().any(|count| count > 0) {
            let cells = counts().map(|count| Cell::count((count > 0).then_some(count)));
            let names = [Cell::text(&c.name), Cell::text(&c.stream), Cell::Count(c.rows)];
            t.row(names.into_iter().chain(cells));
        }
    }
    t
}

fn streaks(sensors: &[SensorStatistics]) -> Table {
    let mut t = Table::new([
        Column::text("sensor"),
        Column::number("rejected in a row"),
        Column::with_unit("from", Unit::of_si("s")),
        Column::with_unit("for", Unit::of_si("s")),
        Column::text("at the end"),
    ]);
    for s in sensors {
        if let Some(r) = &s.longest_rejection_streak {
            let end = if s.ends_denied { Cell::text("denied") } else { Cell::Empty };
            let times = [r.from, r.seconds].map(Cell::Seconds);
            t.row(
                [Cell::text(&s.name), Cell::Count(r.measurements)]
                    .into_iter()
                    .chain(times)
                    .chain([end]),
            );
        }
    }
    t
}

fn innovations_of(sensors: &[SensorStatistics]) -> Section {
    let table = innovations(sensors);
    let section = Section::new("Innovations of accepted measurements", [table]);
    let section = if section.is_empty() { section } else { section.note(LAG) };
    if sensors.iter().flat_map(|s| &s.gate_power).all(|power| !power.is_finite()) {
        return section;
    }
    section.note(POWER)
}

/// The meaning of the lag column of the innovations.
const LAG: &str = "Lag 1: how much each innovation is correlated with the next one; 0 where errors are white, near 1 where they last.";

/// The meaning of the last column of the innovations.
const POWER: &str = "Refused from: the smallest error of that row alone that the gate would have refused, by the median.";

/// RMS, maximum and correlation per row; with a gate, also the error that the gate would reject.
fn innovations(sensors: &[SensorStatistics]) -> Table {
    let is_gated = sensors.iter().flat_map(|s| &s.gate_power).any(|power| power.is_finite());
    let power = is_gated.then(|| Column::number("refused from"));
    let columns = [
        Column::text("residual"),
        Column::number("RMS"),
        Column::number("max"),
        Column::with_unit("at", Unit::of_si("s")),
        Column::number("lag 1"),
    ];
    let mut t = Table::new(columns.into_iter().chain(power));
    for s in sensors.iter().filter(|s| s.innovations.count > 0) {
        for (k, (row, unit)) in residual_rows(s).into_iter().enumerate() {
            let power = s.gate_power.get(k).copied().filter(|power| power.is_finite());
            let power = is_gated.then(|| Cell::real(power));
            let innovations = &s.innovations;
            let values = [
                Cell::Real(innovations.rms[k]),
                Cell::Real(innovations.max[k]),
                Cell::Seconds(innovations.max_time[k]),
                Cell::Ratio(innovations.lag_1[k]),
            ];
            t.row_in(unit, [row_name(s, &row)].into_iter().chain(values).chain(power));
        }
    }
    t
}

/// The NEES of a score, each with its name; `path` replaces the space in the name.
fn nees(score: &Score, path: String) -> impl Iterator<Item = (String, &Consistency)> {
    let all = [NEES[0], "NEES height", NEES[1], NEES[2]].into_iter().zip([
        &score.nees_position,
        &score.nees_height,
        &score.nees_velocity,
        &score.nees_attitude,
    ]);
    all.filter_map(move |(name, c)| Some((name.replacen(' ', &path, 1), c.as_ref()?)))
}

fn errors(score: &Score) -> Section {
    let mut t = Table::new([
        Column::text("error"),
        Column::number("RMS"),
        Column::number("mean"),
        Column::number("max"),
        Column::with_unit("at", Unit::of_si("s")),
        Column::number("mean 3σ"),
        Column::number("inside 3σ"),
        Column::text("verdict"),
    ]);
    let mut add = |values: &Option<Axes>, what: &str, names: [&str; 3], unit: &str| {
        let Some(a) = values else { return };
        // An axis that the reference does not know has no row.
        let is_known = |k: &usize| !(a.rms[*k].is_nan() && a.max[*k].is_nan());
        for (k, name) in (0..3).filter(is_known).map(|k| (k, names[k])) {
            let errors = [a.rms[k], a.mean[k], a.max[k]].map(Cell::Real);
            let values = errors
                .into_iter()
                .chain([Cell::Seconds(a.max_time[k]), Cell::Real(a.three_sigma[k])]);
            // A share can show overconfidence only: 100 % is no sign that 3σ is right.
            let verdict = ConsistencyVerdict::of_share(a.inside[k]).filter(|v| *v != ConsistencyVerdict::Consistent);
            let cells = [Cell::text(format!("{what} {name}"))].into_iter().chain(values);
            let judged = [Cell::Share(a.inside[k]), Cell::verdict(verdict)];
            t.row_in(Unit::shown(unit), cells.chain(judged));
        }
    };
    add(&score.position, "position", NED, "m");
    add(&score.velocity, "velocity", NED, "m/s");
    add(&score.attitude_deg, "attitude", RPY, "deg");
    if t.is_empty() {
        return Section::new("Errors against the reference", []).note("No epoch of the reference lies within the run.");
    }
    let mut plain = |name: &str, unit: &str, rms: Option<f64>, max: Option<f64>| {
        if rms.is_some() {
            t.row_in(Unit::shown(unit), [Cell::text(name), Cell::real(rms), Cell::Empty, Cell::real(max)]);
        }
    };
    let horizontal = |v: f64| score.spread.horizontal.map(|_| v);
    plain(
        "position horizontal",
        "m",
        horizontal(score.horizontal_rms),
        horizontal(score.horizontal_max),
    );
    plain("heading", "deg", score.heading_rmse_deg, None);
    plain("inclination", "deg", score.inclination_rmse_deg, None);
    let section = Section::new(format!("Errors against the reference, {} epochs", score.epochs), [t]);
    let section = share(score).into_iter().fold(section, Section::note);
    let section = if score.steep > 0 {
        section.note(format!(
            "{} epochs with a pitch beyond 80° are left out of roll and yaw, which turn about nearly one axis there; heading, inclination and \
             NEES have them.",
            score.steep
        ))
    } else {
        section
    };
    let section = match score.convergence {
        Some(convergence) => section.note(converged(&convergence)),
        None => section,
    };
    match mounting(score) {
        Some(table) => Section {
            tables: section.tables.into_iter().chain([table]).collect(),
            ..section
        },
        None => section,
    }
}

/// The horizontal error as a share of the distance travelled, as a sentence.
fn share(score: &Score) -> Option<String> {
    score.travelled.map(|t| {
        format!(
            "From what it was at the first epoch, the horizontal position error changed by up to {:.2} % of the {:.0} m travelled (from the \
             origin), by {:.2} % for reciprocal lines, \
             which cancel constant errors of scale and heading.",
            t.from_origin_percent, t.distance, t.reciprocal_percent
        )
    })
}

/// Errors of position and consistency in declared episodes and outside them.
fn episodes(episodes: &Episodes) -> Section {
    let metres = |name: &str| Column::with_unit(name, Unit::of_si("m"));
    let columns = [
        Column::text("part"),
        Column::number("epochs"),
        metres("RMS horizontal"),
        metres("max N"),
        metres("max E"),
    ];
    let nees = NEES.map(Column::number);
    let mut t = Table::new(columns.into_iter().chain(nees));
    for (name, part) in episodes.parts().filter(|(_, part)| part.epochs > 0) {
        let max = part.position.map_or([f64::NAN; 3], |a| a.max);
        let errors = [part.horizontal_rms, max[0], max[1]].map(Cell::Real);
        let nees = part.nees.map(|c| Cell::real(c.map(|c| c.mean)));
        t.row([Cell::text(name), Cell::from(part.epochs)].into_iter().chain(errors).chain(nees));
    }
    Section::new("Errors in declared episodes and outside", [t])
}

/// Whether a run has converged, as a sentence.
pub(super) fn converged(convergence: &Convergence) -> String {
    match convergence {
        Convergence {
            after: Some(after),
            converged,
        } => {
            let late = if *converged { "" } else { ", later than declared" };
            format!("Within the declared limits from {after:.1} s after the start on{late}.")
        }
        Convergence { after: None, .. } => "Outside the declared limits at the end: not converged.".to_owned(),
    }
}

/// Epochs without a NEES, a sentence for each of position, velocity, attitude.
fn undefined(score: &Score) -> impl Iterator<Item = String> {
    let counts = NEES.into_iter().zip(score.nees_undefined);
    let blocks = score.blocks.iter().filter(|b| is_judged_as_block(b));
    let all = counts.map(|(name, n)| (name.to_owned(), n));
    let all = all.chain(blocks.map(|b| (format!("NEES {}", b.name), b.nees_undefined)));
    all.filter(|(_, count)| *count > 0).map(|(name, count)| {
        format!("{name}: left out {count} epochs: no sound covariance, no finite error, or fewer directions estimated than at others")
    })
}

/// Parameters against the truth that a simulation drew.
fn parameters(score: &Score) -> Section {
    let numbers = ["RMS", "mean 3σ", "inside 3σ", "at the end", "1σ there"].map(Column::number);
    let mut t = Table::new([Column::text("error")].into_iter().chain(numbers));
    for block in score.blocks.iter().filter(|b| b.is_parameter) {
        for k in 0..block.error.len() {
            let name = Cell::text(axis_name(block, k));
            let over = [
                Cell::Real(block.rms[k]),
                Cell::Real(block.three_sigma[k]),
                Cell::Share(block.inside[k]),
            ];
            let end = [block.error[k], block.sigma[k]].map(Cell::Real);
            t.row_in(Unit::of_si(&block.unit), [name].into_iter().chain(over).chain(end));
        }
    }
    Section::new("Errors of the estimated parameters", [t])
}

fn mounting(score: &Score) -> Option<Table> {
    let angles = score.mounting_deg?;
    let columns = RPY.map(|axis| Column::with_unit(axis, Unit::shown("deg")));
    let mut t = Table::new([Column::text("removed from the errors")].into_iter().chain(columns));
    let cells = angles.map(Cell::Real);
    t.row([Cell::text("mean mounting of the reference")].into_iter().chain(cells));
    Some(t)
}

/// Drift per outage, and next to it the drift of smoothed estimates over the same epochs.
fn drift(score: &Score, smoothed: Option<&Score>) -> Section {
    let (seconds, metres) = (|| Unit::of_si("s"), || Unit::of_si("m"));
    let beside = |title: &str| smoothed.map(|_| Column::with_unit(title, metres()));
    let of_smoothed = |figure: fn(&Score) -> Option<f64>| smoothed.map(|score| Cell::real(figure(score)));
    let columns = [
        Column::with_unit("from", seconds()),
        Column::with_unit("to", seconds()),
        Column::with_unit("max horizontal error", metres()),
        Column::with_unit("growth", metres()),
        Column::with_unit("at the end", metres()),
        Column::with_unit("3σ there", metres()),
        Column::number("error/σ"),
    ];
    let mut t = Table::new(columns.into_iter().chain(beside("smoothed max")));
    for (k, d) in score.drift.iter().take(OUTAGES).enumerate() {
        let cells = [
            Cell::Seconds(d.from),
            Cell::Seconds(d.to),
            Cell::Real(d.max_horizontal),
            Cell::Real(d.growth),
            Cell::Real(d.end_horizontal),
            Cell::Real(3.0 * d.end_sigma),
            Cell::Real(d.end_ratio()),
        ];
        let beside = smoothed.map(|s| Cell::real(s.drift.get(k).map(|d| d.max_horizontal)));
        t.row(cells.into_iter().chain(beside));
    }
    let columns = [
        Column::number("outages"),
        Column::with_unit("RMS of max", metres()),
        Column::with_unit("median of max", metres()),
    ];
    let beside = beside("smoothed RMS").into_iter().chain(beside("smoothed median"));
    let mut all = Table::new(columns.into_iter().chain(beside));
    if let (Some(rms), Some(median)) = (score.drift_rms, score.drift_median) {
        let cells = [Cell::from(score.drift.len()), Cell::Real(rms), Cell::Real(median)];
        let beside = [of_smoothed(|s| s.drift_rms), of_smoothed(|s| s.drift_median)];
        all.row(cells.into_iter().chain(beside.into_iter().flatten()));
    }
    let section = Section::new("Drift in outages", [t, all]);
    if score.drift.is_empty() {
        return section;
    }
    let section = section
        .note("Growth: the largest change of the error, as a vector, since the outage began.")
        .note("At the end: the horizontal error at its last epoch, its 3σ in its own direction, and how many σ it is.");
    let section = if score.drift.iter().any(|d| d.is_cut) {
        section.note("An outage that was not over when the run ended is scored to there.")
    } else {
        section
    };
    if score.drift.len() > OUTAGES {
        return section.note(format!("The first {OUTAGES} outages are listed; summary.json has all of them."));
    }
    section
}

/// The same table of the estimates that the vehicle had.
fn current_errors(score: &Score) -> Section {
    let section = errors(score);
    Section {
        title: format!("{}, each as it was before later rows came", section.title),
        ..section
    }
}

/// The same table of smoothed estimates.
fn smoothed_errors(how: &Smoothed, score: &Score) -> Section {
    let data = how
        .lag
        .map_or_else(|| "all data".to_owned(), |lag| format!("data of {lag} s after it"));
    let section = errors(score);
    let section = Section {
        title: format!("{}, each smoothed by {data}", section.title),
        ..section
    };
    match &how.iteration {
        Some(how) => section.note(iteration(how)),
        None => section,
    }
}

/// How an iteration of smoothing ended.
fn iteration(how: &Iteration) -> String {
    let times = match how.iterations {
        1 => "once".to_owned(),
        times => format!("{times} times"),
    };
    let end = if how.is_converged {
        "no state is further than 1e-6 σ from the optimum".to_owned()
    } else {
        format!("not converged, {:.1e} σ from the optimum", how.distance)
    };
    format!("Linearised {times} at the smoothed states: {end}.")
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::run::Start;
    use fusion::score::Consistency;
    use fusion_core::geometry::so3;

    #[test]
    fn a_run_that_never_started_says_what_it_waits_for() {
        let summary = Summary::default().with(Start {
            waiting: vec![("fix".to_owned(), "a position".to_owned())],
            ..Start::default()
        });
        assert_eq!(Shown(&summary).warnings(), ["the filter never started: `fix` waits for a position"]);
        let text = Shown(&summary).to_string();
        let lines: Vec<&str> = text.lines().map(str::trim).collect();
        let at = lines.iter().position(|l| l.starts_with("started")).unwrap();
        assert!(
            lines[at].ends_with("never") && lines[at + 1] == "`fix` waits for a position",
            "{text}"
        );
    }

    #[test]
    fn an_estimated_mounting_is_shown_in_degrees_of_roll_pitch_and_yaw() {
        // 10° of pitch and 1° of 1σ about each body axis.
        let q = so3::from_rpy(0.0, 10_f64.to_radians(), 0.0);
        let mut value = vec![0.0; 4];
        Attitude::write(&q, &mut value);
        let variance = 1_f64.to_radians().powi(2);
        let state = FinalState {
            name: "wheels.mounting".to_owned(),
            kind: Kind::Attitude,
            value,
            sigma: vec![1_f64.to_radians(); 3],
            start_sigma: Vec::new(),
            covariance: (Matrix3::<f64>::identity() * variance).as_slice().to_vec(),
            unit: "rad",
        };
        let summary = Summary::default().with(vec![state]);
        let section = Shown(&summary).estimated();
        let table = &section.tables[0];
        let shown: Vec<String> = table.rows().iter().map(|r| table.shown(r, 0) + " " + &table.shown(r, 1)).collect();
        let names = ["roll", "pitch", "yaw"].map(|a| format!("wheels.mounting {a} [deg]"));
        assert_eq!(
            shown,
            [format!("{} 0", names[0]), format!("{} 10.00", names[1]), format!("{} 0", names[2])]
        );
        let html = fusion_tables::html::sections(core::slice::from_ref(&section)).into_string();
        assert!(
            html.contains("wheels.mounting pitch [deg]</th><td>10.00</td><td>1.000</td>"),
            "{html}"
        );
        // Roll and yaw turn about axes that the pitch has moved: 1/cos 10° and tan 10° of it.
        assert_eq!(table.shown(&table.rows()[2], 2), format!("{:.3}", 1.0 / 10_f64.to_radians().cos()));
    }

    #[test]
    fn an_axis_that_leaves_its_3_sigma_is_overconfident_in_every_form() {
        let axes = Axes {
            inside: [0.5, 0.999, 1.0],
            ..Axes::default()
        };
        let nan = Consistency {
            mean: f64::NAN,
            dof: 3,
            count: 9,
            independent: 9.0,
            band: (1.0, 5.0),
        };
        let summary = Summary::default().with(Score {
            epochs: 9,
            position: Some(axes),
            nees_position: Some(nan),
            ..Score::default()
        });
        let page = Shown(&summary).page();
        let forms = [
            text::page(&page, text::WIDTH),
            fusion_tables::json::page(&page).to_string(),
            fusion_tables::html::sections(&page.sections).into_string(),
        ];
        for form in forms {
            // Once as a verdict; the other is the note that explains the word.
            assert_eq!(form.matches("overconfident").count(), 2, "{form}");
            assert!(!form.contains("NaN") && form.contains("NEES position"), "{form}");
        }
    }

    #[test]
    fn an_angle_that_is_not_estimated_has_no_sigma_though_the_others_change_it() {
        let mounting = |start_sigma: Vec<f64>| FinalState {
            name: "wheels.mounting".to_owned(),
            kind: Kind::Attitude,
            value: vec![0.99, 0.0, 0.1, 0.1],
            sigma: vec![0.0, 1e-3, 1e-3],
            start_sigma,
            covariance: vec![0.0, 0.0, 0.0, 0.0, 1e-6, 0.0, 0.0, 0.0, 1e-6],
            unit: "rad",
        };
        let shown = |start_sigma: Vec<f64>| {
            let summary = Summary::default().with(vec![mounting(start_sigma)]);
            let section = Shown(&summary).estimated();
            let is_fixed = format!("{section:?}").matches("not estimated").count();
            (is_fixed, section.notes.join(" "))
        };
        let (fixed, notes) = shown(vec![0.0, 0.1, 0.1]);
        assert!(
            fixed == 1 && notes.contains("`wheels.mounting roll` was declared with a 1σ of 0"),
            "{notes}"
        );
        assert_eq!(shown(vec![0.1; 3]), (0, String::new()));
    }
}
