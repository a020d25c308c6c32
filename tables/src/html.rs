//! Sections as HTML: the same names, units and digits as in a terminal, set as on paper.

use super::tree::{Cell, Column, Section, Table};
use fusion::score::ConsistencyVerdict;
use maud::{Markup, html};

/// `sections` below a heading of level 2.
#[must_use]
pub fn sections(sections: &[Section]) -> Markup {
    html! {
        @for section in sections.iter().filter(|s| !s.is_empty()) {
            @if !section.title.is_empty() { h3 { (section.title) } }
            @for t in &section.tables { (table(t)) }
            @for note in &section.notes { p.hint { (note) } }
        }
    }
}

fn table(table: &Table) -> Markup {
    html! {
        div.table { table {
            @if !table.is_list() {
                thead { tr {
                    @for (_, column) in table.columns() {
                        th scope="col" class=[column.is_text.then_some("text")] { (column.heading()) }
                    }
                } }
            }
            tbody {
                @for row in table.rows() {
                    tr {
                        @for (k, column) in table.columns() {
                            @let shown = typeset(&row.cells[k], &table.shown(row, k));
                            @if k == 0 {
                                th scope="row" { (shown) }
                            } @else {
                                td class=[class(column, &row.cells[k], &shown)] { (shown) }
                            }
                        }
                    }
                }
            }
        } }
    }
}

/// Text of so many characters is a sentence, which may break.
const SENTENCE: usize = 40;

fn class(column: &Column, cell: &Cell, shown: &str) -> Option<String> {
    let is_bad = cell.judgement().is_some_and(|v| v != ConsistencyVerdict::Consistent);
    let is_long = column.is_text && shown.chars().count() > SENTENCE;
    let all = [("text", column.is_text), ("long", is_long), ("bad", is_bad)];
    let names: Vec<&str> = all.into_iter().filter(|(_, is)| *is).map(|(name, _)| name).collect();
    (!names.is_empty()).then(|| names.join(" "))
}

/// With a minus sign for a hyphen, and counts in groups of three digits; words stay as they are.
fn typeset(cell: &Cell, shown: &str) -> String {
    match cell {
        Cell::Empty | Cell::Text(_) | Cell::Verdict(_) => shown.to_owned(),
        Cell::Count(n) => grouped(*n),
        _ => shown.replace('-', "−"),
    }
}

fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Unit;

    #[test]
    fn a_table_has_its_units_its_signs_and_its_verdicts() {
        let mut t = Table::new([
            Column::text("what"),
            Column::number("mean"),
            Column::number("rows"),
            Column::text("verdict"),
        ]);
        let cells = [
            Cell::text("a <b>-c"),
            Cell::Real(-0.5),
            Cell::Count(1_234_567),
            Cell::Verdict(ConsistencyVerdict::Overconfident),
        ];
        t.row_in(Unit::of_si("m"), cells);
        let page = sections(&[Section::new("S", [t]).note("n")]).into_string();
        for part in [
            "<h3>S</h3>",
            "<th scope=\"row\">a &lt;b&gt;-c [m]</th>",
            "<td>−0.5000</td>",
            "<td>1\u{202f}234\u{202f}567</td>",
            "<td class=\"text bad\">overconfident</td>",
            "<p class=\"hint\">n</p>",
        ] {
            assert!(page.contains(part), "{part} in {page}");
        }
    }
}
