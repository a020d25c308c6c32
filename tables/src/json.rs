//! A page as JSON: every number in full precision, in the unit that is shown.
//!
//! ```json
//! {"title": "…", "provenance": {…}, "warnings": [], "sections": [{"title": "Sensors", "notes": [], "tables": [{
//!   "columns": [{"name": "quantity"}, {"name": "RMS"}, {"name": "at", "unit": "s"}],
//!   "rows": [{"unit": "m", "cells": ["east", 1.0625, 12.5]}]}]}]}
//! ```
//!
//! A cell is `null` where there is nothing to say or no number, a share is a fraction of 1, a band
//! is `[from, to]`, a mean with its verdict `{"mean": …, "verdict": …}`.

use super::tree::{Cell, Column, Page, Section, Table, TableRow};
use super::unit::Unit;
use serde_json::{Value, json};

/// `page` as a JSON value.
#[must_use]
pub fn page(page: &Page) -> Value {
    let shown = page.sections.iter().filter(|s| !s.is_empty());
    json!({
        "title": page.title,
        "provenance": page.provenance,
        "warnings": page.warnings,
        "sections": shown.map(section).collect::<Vec<_>>(),
    })
}

fn section(section: &Section) -> Value {
    json!({
        "title": section.title,
        "tables": section.tables.iter().map(table).collect::<Vec<_>>(),
        "notes": section.notes,
    })
}

fn table(table: &Table) -> Value {
    let row = |row: &TableRow| {
        let cells = table.columns().map(|(k, _)| cell(&row.cells[k], table.unit(row, k)));
        with_unit(json!({ "cells": cells.collect::<Vec<_>>() }), Some(&row.unit))
    };
    let column = |column: &Column| with_unit(json!({ "name": column.name }), column.unit.as_ref());
    json!({
        "columns": table.columns().map(|(_, c)| column(c)).collect::<Vec<_>>(),
        "rows": table.rows().iter().map(row).collect::<Vec<_>>(),
    })
}

fn with_unit(mut value: Value, unit: Option<&Unit>) -> Value {
    if let Some(unit) = unit.filter(|u| !u.symbol().is_empty()) {
        value["unit"] = unit.symbol().into();
    }
    value
}

/// Numbers that are not finite become `null`.
fn cell(cell: &Cell, unit: &Unit) -> Value {
    match cell {
        Cell::Empty => Value::Null,
        Cell::Text(text) => text.as_str().into(),
        Cell::Count(n) => (*n).into(),
        Cell::Real(v) | Cell::Fixed(v, _) => unit.of(*v).into(),
        Cell::Seconds(v) | Cell::Ratio(v) | Cell::Share(v) => (*v).into(),
        Cell::Band(low, high) => json!([unit.of(*low), unit.of(*high)]),
        Cell::Verdict(v) => v.word().into(),
        Cell::Judged(c) => json!({ "mean": c.mean, "expected": c.dof, "verdict": c.verdict().map(|v| v.word()) }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion::provenance::Provenance;

    #[test]
    fn values_have_the_unit_of_their_column_or_row() {
        let mut t = Table::new([
            Column::text("quantity"),
            Column::number("RMS"),
            Column::with_unit("at", Unit::of_si("s")),
            Column::number("band"),
        ]);
        let cells = [
            Cell::text("yaw"),
            Cell::Real(core::f64::consts::PI),
            Cell::Real(f64::NAN),
            Cell::Band(1.0, 2.0),
        ];
        t.row_in(Unit::of_si("rad"), cells);
        let written = page(&Page {
            title: "t".to_owned(),
            provenance: Provenance::default(),
            warnings: vec!["w".to_owned()],
            sections: vec![Section::new("s", [t]).note("n"), Section::new("empty", [])],
        });
        let columns = json!([{"name": "quantity"}, {"name": "RMS"}, {"name": "at", "unit": "s"}, {"name": "band"}]);
        let (turn, degree) = (180.0, 1_f64.to_degrees());
        let rows = json!([{"unit": "deg", "cells": ["yaw", turn, null, [degree, 2.0 * degree]]}]);
        let sections = json!([{"title": "s", "tables": [{"columns": columns, "rows": rows}], "notes": ["n"]}]);
        let provenance = json!({"design": "", "variants": [], "set": [], "seed": null, "hash": "", "version": ""});
        let wanted = json!({"title": "t", "provenance": provenance, "warnings": ["w"], "sections": sections});
        assert_eq!(written, wanted);
    }
}
