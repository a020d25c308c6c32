//! What a run prints: aligned columns of at most [`WIDTH`] characters, and the summary made of them.

use crate::run::{FinalState, Summary};
use crate::score::{Axes, Consistency, Drift, Score};
use crate::tally::{Innovations, SensorTally, counts};
use fusion_core::filter::Backend;
use fusion_core::geometry::so3;
use fusion_core::state::{Attitude, Manifold};
use std::fmt;

/// Characters in a line at most.
pub const WIDTH: usize = 100;
/// Between two columns.
const GAP: &str = "  ";
/// A last column narrower than this is not worth wrapping.
const NARROW: usize = 24;
/// Where the text of such a column begins, on lines of its own.
const BELOW: usize = 8;
/// Outages listed one by one; the rest is in summary.json.
const OUTAGES: usize = 20;

/// On which side a column's cells end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

/// Rows of cells under a header; the last column is wrapped where a line would exceed [`WIDTH`].
#[derive(Clone, Debug)]
pub struct Table {
    columns: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// With these columns; `>` before a title aligns its cells to the right.
    #[must_use]
    pub fn new(titles: &[&str]) -> Self {
        let column = |title: &&str| match title.strip_prefix('>') {
            Some(title) => (title.to_owned(), Align::Right),
            None => ((*title).to_owned(), Align::Left),
        };
        Self {
            columns: titles.iter().map(column).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; cells that are missing are empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.columns.len(), String::new());
        self.rows.push(cells);
    }

    /// Whether it has no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn widths(&self) -> Vec<usize> {
        let width = |k: usize| {
            self.rows
                .iter()
                .map(|r| length(&r[k]))
                .chain([length(&self.columns[k].0)])
                .max()
                .unwrap_or(0)
        };
        (0..self.columns.len()).map(width).collect()
    }

    fn line(&self, f: &mut fmt::Formatter<'_>, cells: &[String], widths: &[usize]) -> fmt::Result {
        let (Some(last), Some((_, align))) = (cells.last(), self.columns.last()) else {
            return Ok(());
        };
        let mut line = String::new();
        for ((cell, width), (_, align)) in cells.iter().zip(widths).zip(&self.columns).take(cells.len() - 1) {
            line.push_str(GAP);
            line.push_str(&padded(cell, *width, *align));
        }
        let before = length(&line) + GAP.len();
        if *align == Align::Right {
            line.push_str(GAP);
            line.push_str(&padded(last, widths[cells.len() - 1], *align));
            return writeln!(f, "{}", line.trim_end());
        }
        let room = WIDTH.saturating_sub(before);
        // A column that has become too narrow to read goes below the others.
        let is_below = room < NARROW && length(last) > room;
        let (hang, room) = if is_below { (BELOW, WIDTH - BELOW) } else { (before, room) };
        if is_below {
            writeln!(f, "{}", line.trim_end())?;
        }
        for (k, part) in wrapped(last, room).iter().enumerate() {
            let start = if k == 0 && !is_below {
                format!("{line}{GAP}")
            } else {
                " ".repeat(hang)
            };
            writeln!(f, "{}", format!("{start}{part}").trim_end())?;
        }
        Ok(())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let titles: Vec<String> = self.columns.iter().map(|(title, _)| title.clone()).collect();
        if titles.iter().any(|t| !t.is_empty()) {
            self.line(f, &titles, &widths)?;
        }
        self.rows.iter().try_for_each(|row| self.line(f, row, &widths))
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

fn padded(cell: &str, width: usize, align: Align) -> String {
    match align {
        Align::Left => format!("{cell:<width$}"),
        Align::Right => format!("{cell:>width$}"),
    }
}

/// `text` in lines of at most `width` characters, broken at blanks; its own line breaks are kept.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for paragraph in text.split('\n') {
        let mut line: String = paragraph.chars().take_while(|c| *c == ' ').collect();
        let indent = line.len();
        for word in paragraph.split_whitespace() {
            if length(&line) > indent {
                if length(&line) + 1 + length(word) > width {
                    lines.push(core::mem::replace(&mut line, " ".repeat(indent)));
                } else {
                    line.push(' ');
                }
            }
            line.push_str(word);
        }
        lines.push(line);
    }
    lines
}

/// Four significant digits.
#[must_use]
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-3..1e6).contains(&size) {
        fixed(value, decimals(size))
    } else {
        format!("{value:.3e}")
    }
}

fn fixed(value: f64, decimals: usize) -> String {
    // Adding zero takes the sign off a negative one.
    let rounded = format!("{:.decimals$}", value + 0.0);
    if rounded.trim_matches(['-', '0', '.']).is_empty() {
        rounded.trim_start_matches('-').to_owned()
    } else {
        rounded
    }
}

/// Decimals that give a number of this size four significant digits.
fn decimals(size: f64) -> usize {
    if size > 0.0 && size.is_finite() {
        (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        0
    }
}

/// Equal numbers as one, others as a list.
#[must_use]
pub fn numbers(values: &[f64]) -> String {
    match values {
        [] => String::new(),
        [first, rest @ ..] if rest.iter().all(|v| v == first) => short(*first),
        _ => values.iter().map(|v| short(*v)).collect::<Vec<_>>().join(", "),
    }
}

/// Four significant digits at most, without trailing zeros.
#[must_use]
pub fn short(value: f64) -> String {
    let text = number(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// The factor and the unit in which people read something counted in `unit`: degrees for radians.
#[must_use]
pub fn readable(unit: &str) -> (f64, String) {
    match unit.strip_prefix("rad") {
        Some(rest) => (1_f64.to_degrees(), format!("deg{rest}")),
        None => (1.0, unit.to_owned()),
    }
}

/// The backend in the words of TOML: `body / single / joseph`.
#[must_use]
pub fn backend_name(backend: &Backend) -> String {
    let words = [
        format!("{:?}", backend.chart),
        format!("{:?}", backend.update),
        format!("{:?}", backend.form),
    ];
    words.map(|word| snake(&word)).join(" / ")
}

fn snake(word: &str) -> String {
    let mut out = String::new();
    for c in word.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}

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

/// A count, or an empty cell where it is not known.
pub(crate) fn count_cell(count: Option<u64>) -> String {
    count.map_or_else(String::new, |n| n.to_string())
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

/// Each residual row of a sensor, `north [m]`, and the factor from SI to that unit.
pub(crate) fn residual_rows(s: &SensorTally) -> Vec<(String, f64)> {
    let Innovations { axis, unit, .. } = &s.innovations;
    let row = |(k, si): (usize, &String)| {
        let (factor, shown) = readable(si);
        let row = match axis.get(k) {
            Some(name) => format!("{name} [{shown}]"),
            None if unit.len() > 1 => format!("{} [{shown}]", k + 1),
            None => format!("[{shown}]"),
        };
        (row, factor)
    };
    unit.iter().enumerate().map(row).collect()
}

fn errors(f: &mut fmt::Formatter<'_>, score: &Score) -> fmt::Result {
    let mut t = Table::new(&["", ">RMS", ">mean", ">max", ">3σ", ">inside 3σ"]);
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
    fn columns_are_aligned_and_the_last_one_is_wrapped() {
        let mut t = Table::new(&["name", ">rows", "note"]);
        t.row(["imu", "12000", "σ"]);
        t.row(["gnss", "9", &"word ".repeat(20)]);
        let line = "word ".repeat(17);
        let expected = format!(
            "  name   rows  note\n  imu   12000  σ\n  gnss      9  {}\n               word word word\n",
            line.trim_end()
        );
        assert_eq!(t.to_string(), expected);
        assert!(t.to_string().lines().all(|l| l.chars().count() <= WIDTH));
    }

    #[test]
    fn a_column_too_narrow_to_read_goes_below() {
        let mut t = Table::new(&["", ""]);
        t.row(["a".repeat(80), "b ".repeat(15)]);
        assert_eq!(
            t.to_string(),
            format!("  {}\n        {}\n", "a".repeat(80), "b ".repeat(15).trim_end())
        );
    }

    #[test]
    fn numbers_keep_four_digits() {
        let cases = [
            (0.0, "0"),
            (-0.000_000_1, "-1.000e-7"),
            (12.3456, "12.35"),
            (-0.012_345, "-0.01235"),
            (98765.4, "98765"),
            (1.5e6, "1.500e6"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
        assert_eq!(
            (fixed(-0.0001, 2).as_str(), short(2.5).as_str(), numbers(&[2.0; 3]).as_str()),
            ("0.00", "2.5", "2")
        );
    }

    #[test]
    fn angles_are_read_in_degrees() {
        assert_eq!(readable("rad/s").1, "deg/s");
        assert_eq!(readable("m"), (1.0, "m".to_owned()));
    }

    #[test]
    fn a_backend_is_spelt_as_in_toml() {
        assert_eq!(backend_name(&Backend::EKF), "additive_euler / single / joseph");
    }

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
