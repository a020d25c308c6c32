//! A design under drawn faults.

use crate::Shown;
use fusion_judge::stress::draw::{Count, Counts, Drawn, DrawnResult};
use fusion_tables::Unit;
use fusion_tables::{Cell, Column, Page, Section, Table};

/// The longest list of worst cases.
const WORST: usize = 20;

impl Shown<'_, Drawn> {
    /// As it is shown: counts, and the worst cases. `again` is the command that ran it, but for `--case`.
    #[must_use]
    pub fn page(&self, again: &str) -> Page {
        let all = self.counts();
        let mut warnings = Vec::new();
        if self.fails() {
            let [recovered, false_good] = self.limits.map(|limit| Cell::Share(limit).shown(&Unit::none()));
            warnings.push(format!(
                "{} of {} cases recovered, at least {recovered} are asked for; {} were false goods, at most {false_good} are allowed",
                all.recovered.count, all.cases, all.false_good.count
            ));
        }
        if !self.is_whole {
            warnings.push(format!(
                "the log is too short: {:.1} s of good data are left after the faults; see `left`, `longest` and `settle` under [stress]",
                self.left
            ));
        }
        for row in &self.rows {
            if let Some(why) = &row.judged.stopped {
                warnings.push(format!("case {}: the run stopped: {why}", row.number));
            }
        }
        let kinds = self.by_kind();
        let by_kind = counted("kind", kinds.iter().map(|(kind, counts)| ((*kind).to_owned(), counts)));
        let numbers = self.by_number();
        let together = core::iter::once(("all".to_owned(), &all)).chain(numbers.iter().map(|(n, counts)| (format!("{n} at once"), counts)));
        let mut worst: Vec<&DrawnResult> = self.rows.iter().filter(|row| badness(row) > (0, 0.0)).collect();
        worst.sort_by(|a, b| {
            let (a, b) = (badness(a), badness(b));
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        let shown = worst.len().min(WORST);
        let title = match worst.len() {
            n if n == shown => "Worst cases".to_owned(),
            n => format!("Worst cases, {shown} of {n}"),
        };
        let alone = worst.first().map_or_else(
            || "Of no case is there anything to say.".to_owned(),
            |first| format!("One case alone, here case {0}: {again} --case {0}", first.number),
        );
        Page {
            provenance: self.provenance.clone(),
            title: format!("{}, under drawn faults: {} cases", self.description, self.rows.len()),
            warnings,
            sections: vec![
                self.explained(Section::new("Cases", [counted("", together)])),
                Section::new("By kind", [by_kind])
                    .note("A case with faults of several kinds counts in the row of each. Intervals of shares: 95 %, Wilson."),
                Section::new(title, [cases(worst.iter().take(WORST).copied())]).note(alone),
            ],
        }
    }

    fn explained(&self, section: Section) -> Section {
        let reference = if self.has_reference {
            "the reference"
        } else {
            "the undisturbed run"
        };
        let own = if self.has_reference { "root mean square error" } else { "own 1σ" };
        let rms = self.of.iter().zip(&self.undisturbed).map(|(of, rms)| {
            let unit = match of.as_str() {
                "position" => Unit::of_si("m"),
                "velocity" => Unit::of_si("m/s"),
                _ => Unit::of_si("rad"),
            };
            format!("{of} {}", unit.list(&[*rms]))
        });
        let rms: Vec<String> = rms.collect();
        section.note(format!(
            "Errors against {reference} that the undisturbed run does not have; its {own}: {}. An error is large beyond 3σ or \
             twice that. recovered: not large over the end of the run. false good: health good while the error is beyond 10σ, \
             for 3 s. false alarm: health degraded or lost, the error never large. late good: health degraded or lost for long \
             after the error had returned, of those recovered. What the undisturbed run says is no alarm.",
            rms.join(", ")
        ))
    }
}

/// The counts of some groups of cases.
fn counted<'a>(what: &str, groups: impl Iterator<Item = (String, &'a Counts)>) -> Table {
    let mut columns = vec![Column::text(what), Column::number("cases")];
    for name in ["recovered", "false good", "false alarm", "late good"] {
        columns.extend([Column::number(name), Column::number("[%]")]);
    }
    let mut t = Table::new(columns);
    for (name, counts) in groups {
        let mut cells = vec![Cell::from(name), Cell::from(counts.cases)];
        for count in [counts.recovered, counts.false_good, counts.false_alarm, counts.late_good] {
            cells.extend([Cell::from(count.count), interval(count)]);
        }
        t.row(cells);
    }
    t
}

/// In percent.
fn interval(count: Count) -> Cell {
    count.interval().map_or(Cell::Empty, |(low, high)| {
        Cell::text(format!("{:.0}…{:.0}", 100.0 * low, 100.0 * high))
    })
}

/// The order of the list: false goods first, then errors that stay, then late and false alarms; by the size of the error.
fn badness(row: &DrawnResult) -> (u8, f64) {
    let judged = &row.judged;
    let rank =
        8 * u8::from(judged.false_good) + 4 * u8::from(!judged.recovered) + 2 * u8::from(judged.late_good) + u8::from(judged.false_alarm);
    let size = judged.worst.map_or(f64::INFINITY, |(ratio, _)| ratio);
    (rank, if rank > 0 { size } else { 0.0 })
}

fn cases<'a>(rows: impl Iterator<Item = &'a DrawnResult>) -> Table {
    let mut t = Table::new([
        Column::number("case"),
        Column::text("fault"),
        Column::text("on"),
        Column::text("size"),
        Column::with_unit("from", Unit::of_si("s")),
        Column::with_unit("worst", Unit::shown("σ")),
        Column::with_unit("end", Unit::shown("σ")),
        Column::with_unit("end", Unit::shown("RMS")),
        Column::text(""),
    ]);
    for DrawnResult { number, case, judged, .. } in rows {
        let decimal = |value: f64| if value < 1e5 { Cell::Fixed(value, 1) } else { Cell::Real(value) };
        let of = |size: Option<f64>| size.map_or(Cell::Empty, decimal);
        t.row([
            Cell::Count(*number),
            Cell::text(&case.fault),
            Cell::text(&case.on),
            Cell::text(&case.size),
            Cell::time(case.from),
            of(judged.worst.map(|w| w.0)),
            of(judged.end.map(|e| e.0)),
            of(judged.end.map(|e| e.1)),
            Cell::text(judged.words().join(", ")),
        ]);
    }
    t
}
