//! Sections that observers of other crates made, as tables.

use fusion::observe::{Figure, RunSection, Summary};
use fusion_tables::{Cell, Column, Section, Table, Unit};

/// The sections of the short result of a run.
pub(crate) fn brief(summary: &Summary) -> impl Iterator<Item = Section> {
    summary.shown().filter(|section| !section.is_detail).map(of)
}

/// The sections of a run.
pub(crate) fn all(summary: &Summary) -> impl Iterator<Item = Section> {
    summary.shown().map(of)
}

fn of(section: RunSection) -> Section {
    let is_text = |k: usize| section.rows.iter().any(|row| matches!(row.get(k), Some(Figure::Text(_))));
    let columns = section.columns.iter().enumerate().map(|(k, column)| match column.unit.as_str() {
        _ if is_text(k) => Column::text(&column.name),
        "" => Column::number(&column.name),
        si => Column::with_unit(&column.name, Unit::of_si(si)),
    });
    let mut table = Table::new(columns);
    for row in &section.rows {
        table.row(row.iter().map(|figure| match figure {
            Figure::Text(words) => Cell::text(words),
            Figure::Count(count) => Cell::Count(*count),
            Figure::Number(number) if number.is_nan() => Cell::Empty,
            Figure::Number(number) => Cell::Real(*number),
        }));
    }
    Section {
        notes: section.notes,
        ..Section::new(&section.title, [table])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::observe::SectionColumn;
    use fusion_tables::text;

    #[test]
    fn numbers_are_shown_in_the_usual_unit_of_their_column() {
        let column = |name: &str, unit: &str| SectionColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
        };
        let section = RunSection {
            name: "turns".to_owned(),
            title: "Turns".to_owned(),
            columns: vec![column("axis", ""), column("fastest", "rad/s"), column("rows", "")],
            rows: vec![
                vec![Figure::Text("yaw".to_owned()), Figure::Number(0.5), Figure::Count(12_000)],
                vec![Figure::Text("roll".to_owned()), Figure::Number(f64::NAN), Figure::Count(3)],
            ],
            notes: vec!["Faster than a car.".to_owned()],
            is_detail: false,
        };
        let page = fusion_tables::Page {
            sections: all(&Summary::default().with(section)).collect(),
            ..fusion_tables::Page::default()
        };
        let shown = text::page(&page, text::WIDTH);
        for part in ["Turns", "fastest [deg/s]", "28.65", "12000", "Faster than a car."] {
            assert!(shown.contains(part), "{part}: {shown}");
        }
    }
}
