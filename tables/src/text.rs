//! A page as text for a terminal: aligned columns, numbers to the right, lines no wider than requested.

use super::tree::{Column, Page, Section, Table};
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};
use std::borrow::Cow;
use std::fmt::{self, Write};

/// Characters in a line if the width of the terminal is unknown.
pub const WIDTH: usize = 100;
/// Spaces after each column.
const GAP: usize = 2;
/// Texts of a column up to this length are not wrapped.
const SHORT: usize = 12;
/// Words longer than this may be broken.
const LONG: usize = 32;
/// The text before every line of a table.
const INDENT: &str = "  ";

/// `page` in lines of at most `width` characters. Its warnings are left out, because a command prints them on stderr.
#[must_use]
pub fn page(page: &Page, width: usize) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = write(&mut out, page, width);
    out
}

fn write(out: &mut String, page: &Page, width: usize) -> fmt::Result {
    for line in wrapped(&page.title, width).iter().filter(|line| !line.is_empty()) {
        writeln!(out, "{line}")?;
    }
    for line in wrapped(&page.provenance.line(), width).iter().filter(|line| !line.is_empty()) {
        writeln!(out, "{line}")?;
    }
    for section in page.sections.iter().filter(|s| !s.is_empty()) {
        // A section without a title follows the line before it directly.
        let stands_alone = !section.title.is_empty() || !section.notes.is_empty();
        if stands_alone && !out.is_empty() {
            writeln!(out)?;
        }
        write_section(out, section, width)?;
    }
    Ok(())
}

fn write_section(out: &mut String, section: &Section, width: usize) -> fmt::Result {
    let indent = if section.title.is_empty() { "" } else { INDENT };
    if !section.title.is_empty() {
        writeln!(out, "{}", section.title)?;
    }
    for (k, table) in section.tables.iter().enumerate() {
        if k > 0 {
            writeln!(out)?;
        }
        write_table(out, table, width)?;
    }
    for note in &section.notes {
        for line in wrapped(note, width - indent.len()) {
            writeln!(out, "{}", format!("{indent}{line}").trim_end())?;
        }
    }
    Ok(())
}

fn write_table(out: &mut String, table: &Table, width: usize) -> fmt::Result {
    let mut drawn = comfy_table::Table::new();
    drawn
        .load_preset(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(u16::try_from(width - INDENT.len()).unwrap_or(u16::MAX));
    if !table.is_list() {
        drawn.set_header(table.columns().map(|(_, c)| short(&c.heading()).into_owned()));
    }
    for row in table.rows() {
        drawn.add_row(table.columns().map(|(k, _)| short(&table.shown(row, k)).into_owned()));
    }
    let widths = widths(table, width - INDENT.len());
    for (((_, column), drawn), width) in table.columns().zip(drawn.column_iter_mut()).zip(widths) {
        drawn.set_padding((0, u16::try_from(GAP).unwrap_or(u16::MAX)));
        if !column.is_text {
            drawn.set_cell_alignment(CellAlignment::Right);
        }
        let width = u16::try_from(width + GAP).unwrap_or(u16::MAX);
        drawn.set_constraint(ColumnConstraint::Absolute(Width::Fixed(width)));
    }
    for line in drawn.lines() {
        writeln!(out, "{}", format!("{INDENT}{line}").trim_end())?;
    }
    Ok(())
}

/// Shortens a name to a length that a table can draw; JSON and the report contain the full name.
fn short(text: &str) -> Cow<'_, str> {
    /// Ten lines of a terminal.
    const LONGEST: usize = 1000;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]).into(),
        None => text.into(),
    }
}

fn longest_word(text: &str) -> usize {
    text.split_whitespace().map(|word| word.chars().count()).max().unwrap_or(0)
}

/// The width of each column for a table of at most `width`. First choice: the longest text. Second: the headings of
/// numbers are wrapped. Third: the texts are wrapped, with a common limit for all of them. No column is narrower than
/// its numbers, or than the longest word of its heading or texts.
fn widths(table: &Table, width: usize) -> Vec<usize> {
    let head = |column: &Column| {
        let heading = if table.is_list() { String::new() } else { column.heading() };
        short(&heading).into_owned()
    };
    let of = |(k, column): (usize, &Column)| {
        let head = head(column);
        let cells: Vec<String> = table.rows().iter().map(|row| short(&table.shown(row, k)).into_owned()).collect();
        let longest = |length: fn(&str) -> usize| cells.iter().map(|cell| length(cell)).max().unwrap_or(0);
        let whole = longest(longest_line);
        let words = if column.is_text && whole > SHORT {
            longest(longest_word).min(LONG)
        } else {
            whole
        };
        let least = words.max(longest_word(&head));
        (column.is_text, least, whole.max(longest_line(&head)).max(least))
    };
    let columns: Vec<(bool, usize, usize)> = table.columns().map(of).collect();
    let room = (width + GAP).saturating_sub(GAP * columns.len());
    let at = |of_numbers: usize, of_texts: usize| -> Vec<usize> {
        let level = |is_text: bool| if is_text { of_texts } else { of_numbers };
        columns
            .iter()
            .map(|(is_text, least, most)| level(*is_text).clamp(*least, *most))
            .collect()
    };
    let fits = |widths: &Vec<usize>| widths.iter().sum::<usize>() <= room;
    let heads = (0..=width).rev().map(|level| at(level, usize::MAX));
    let texts = (0..=width).rev().map(|level| at(0, level));
    heads.chain(texts).find(fits).unwrap_or_else(|| at(0, 0))
}

fn longest_line(text: &str) -> usize {
    text.lines().map(|line| line.chars().count()).max().unwrap_or(0)
}

/// `text` in lines of at most `width` characters, broken at blanks; its own line breaks and the
/// indentation of its lines are kept.
#[must_use]
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let length = |text: &str| text.chars().count();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cell, Column, Unit};

    fn of(section: Section) -> String {
        let title = "A title".to_owned();
        page(
            &Page {
                title,
                sections: vec![section],
                ..Page::default()
            },
            40,
        )
    }

    #[test]
    fn numbers_end_at_the_right_and_words_are_wrapped() {
        let mut t = Table::new([Column::text("source"), Column::number("rows"), Column::text("note")]);
        t.row([Cell::text("imu"), Cell::Count(12000), Cell::text("σ")]);
        t.row([Cell::text("gnss"), Cell::Count(9), Cell::text("word ".repeat(6))]);
        let expected = "\
A title

Data
  source   rows  note
  imu     12000  σ
  gnss        9  word word word word
                 word word
  below
";
        assert_eq!(of(Section::new("Data", [t]).note("below")), expected);
    }

    #[test]
    fn a_heading_is_wrapped_before_a_number_is() {
        let names = ["largest horizontal error", "growth of the horizontal error", "mean of the error"];
        let mut t = Table::new(names.map(|n| Column::with_unit(n, Unit::of_si("m"))));
        t.row([12_345.0, 1.0e-9, -0.012_345].map(Cell::Real));
        let text = of(Section::new("", [t]));
        assert!(
            text.contains("12345") && text.contains("1.000e-9") && text.contains("-0.01235"),
            "{text}"
        );
        assert!(text.lines().all(|l| l.chars().count() <= 40), "{text}");
    }

    #[test]
    fn a_list_follows_its_title() {
        let mut t = Table::list();
        t.row_in(Unit::of_si("s"), [Cell::text("started"), Cell::Fixed(1.5, 3)]);
        assert_eq!(of(Section::new("", [t])), "A title\n  started  1.500 s\n");
    }

    #[test]
    fn sections_without_content_are_left_out() {
        assert_eq!(of(Section::new("Nothing", [Table::list()])), "A title\n");
    }

    #[test]
    fn a_name_of_any_length_is_shown() {
        for length in [100, 10_000, 70_000] {
            let long = "n".repeat(length);
            let mut t = Table::new([Column::text("name"), Column::number(long.as_str()), Column::number("b")]);
            t.row([Cell::text(&long), Cell::text(&long), Cell::text(&long)]);
            t.row([Cell::text(&long), Cell::Count(1), Cell::Count(7)]);
            let text = of(Section::new(long.as_str(), [t]).note(long.as_str()));
            assert!(text.matches('n').count() >= 5 * length.min(1000) && text.contains('7'), "{length}");
            assert_eq!(text.contains('…'), length > 1000);
        }
    }
}
