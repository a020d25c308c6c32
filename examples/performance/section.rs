//! The tables of `book/src/speed.md`, made of the lines of `benches/figures.txt`.
//!
//! A line is `name: value`. A name without a slash is a fact about the machine or the build, one with
//! slashes a figure: `group/step/n=15: composed 617 ns, dense 1077 ns, ratio 0.57`, the step, then a rival,
//! then the share of the rival's time; or `group/step: 1.85 s user, 1.99 s by the clock`.

use comfy_table::{CellAlignment, Table};
use std::fmt::Write as _;

/// Where they begin in the page.
pub const BEGIN: &str = "<!-- figures: made by `cargo run --release --example performance` -->";
/// Where it ends.
pub const END: &str = "<!-- /figures -->";

/// The facts that a section names, in their order.
pub const FACTS: [&str; 5] = ["measured", "processor", "kernel", "compiler", "profile"];

/// The title of each group of figures. Other groups come last, under their own names. A figure belongs to the
/// group with the longest name that begins the figure's name.
const GROUPS: [(&str, &str); 8] = [
    (
        "filter",
        "One step of the assembled filter, beside the same of 15 states written by hand on dense matrices; an epoch is a row of the inertial unit fed to the design, with a fix in 200",
    ),
    ("filter/unused", "What parts of a filter cost that do nothing"),
    (
        "kernel",
        "The covariance alone: P ← ΦPΦᵀ + Q, and updates by 3 and 6 rows, beside dense matrices of 15 states, and products of 3×3 blocks and of faer of as many states",
    ),
    (
        "avx2",
        "The same on a processor with AVX2 and without AVX-512: the filter, and the covariance alone, beside the same dense matrices of 15 states",
    ),
    (
        "backend",
        "The same steps with every form, update and chart, beside the dense filter of 15 states",
    ),
    (
        "model",
        "The equations of every process and sensor, beside central differences of them",
    ),
    ("process", "The command as a whole, over a log of text"),
    ("montecarlo", "Many seeds"),
];

/// A table of more rows is folded.
const ROWS: usize = 12;

/// A figure: the step, the number of states, the rival it is compared with, and the duration.
struct Figure {
    step: String,
    states: String,
    rival: String,
    value: String,
}

impl Figure {
    /// Of `name: value`, the name without its group.
    fn read(name: &str, value: &str) -> Self {
        // `predict/n=21, Gauss-Markov` is the step `predict, Gauss-Markov` of 21 states.
        let (step, states) = name.split_once("/n=").map_or((name.to_owned(), String::new()), |(step, rest)| {
            let (states, more) = rest.split_at(rest.find([',', '/']).unwrap_or(rest.len()));
            (format!("{step}{more}"), states.to_owned())
        });
        let parts: Vec<&str> = value.split(", ").collect();
        let (rival, value) = match parts.as_slice() {
            [own, rival, ratio] => compared(own, rival, ratio),
            _ => None,
        }
        .unwrap_or_else(|| (String::new(), value.to_owned()));
        Self {
            step,
            states,
            rival,
            value,
        }
    }
}

/// `composed 617 ns`, `dense 1077 ns` and `ratio 0.57` as the rival and one cell.
fn compared(own: &str, rival: &str, ratio: &str) -> Option<(String, String)> {
    let ratio = ratio.strip_prefix("ratio ")?;
    let (_, own) = own.split_once(' ')?;
    let (rival, time) = rival.split_once(' ')?;
    Some((rival.to_owned(), format!("{own} / {time} = **{ratio}**")))
}

/// All that is different, in order of its first appearance.
fn distinct<'a, T: PartialEq>(all: impl Iterator<Item = T> + 'a) -> Vec<T> {
    all.fold(Vec::new(), |mut seen, one| {
        if !seen.contains(&one) {
            seen.push(one);
        }
        seen
    })
}

/// The figures of one group: a row for each step and rival, a column for each number of states.
fn table(figures: &[Figure]) -> Table {
    let columns = distinct(figures.iter().map(|f| f.states.as_str()));
    let rows = distinct(figures.iter().map(|f| (f.step.as_str(), f.rival.as_str())));
    let is_compared = figures.iter().any(|f| !f.rival.is_empty());
    let mut table = Table::new();
    table.load_preset(comfy_table::presets::ASCII_MARKDOWN);
    let heads = columns
        .iter()
        .map(|n| if n.is_empty() { String::new() } else { format!("{n} states") });
    let beside = |text: &str| is_compared.then(|| text.to_owned());
    table.set_header(["step".to_owned()].into_iter().chain(beside("beside")).chain(heads));
    let first = table.column_count() - columns.len();
    for (step, rival) in rows {
        let cell = |n: &&str| {
            let own = figures.iter().find(|f| f.step == step && f.rival == rival && f.states == *n);
            own.map_or_else(String::new, |f| f.value.clone())
        };
        table.add_row([step.to_owned()].into_iter().chain(beside(rival)).chain(columns.iter().map(cell)));
    }
    for column in first..table.column_count() {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// The group of a figure, and the rest of its name; `None` for a fact.
fn split(name: &str) -> Option<(&str, &str)> {
    let known = GROUPS
        .iter()
        .filter_map(|(group, _)| Some((*group, name.strip_prefix(group)?.strip_prefix('/')?)));
    known.max_by_key(|(group, _)| group.len()).or_else(|| name.split_once('/'))
}

/// The section, with its marks, of the text of `figures.txt`.
///
/// # Errors
/// The missing fact, or the line that cannot be parsed.
pub fn render(text: &str) -> Result<String, String> {
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let pairs: Vec<(&str, &str)> = lines
        .map(|line| line.split_once(": ").ok_or_else(|| format!("this is no `name: value`: {line}")))
        .collect::<Result<_, _>>()?;
    let mut facts = String::new();
    for name in FACTS {
        let fact = pairs.iter().find(|(own, _)| *own == name);
        let (_, value) = fact.ok_or_else(|| format!("there is no line `{name}: …`"))?;
        let _ = write!(facts, "{}{name}: {value}", if facts.is_empty() { "" } else { "; " });
    }
    let figures = pairs.iter().filter_map(|(name, value)| Some((split(name)?, value)));
    let mut groups: Vec<(&str, Vec<Figure>)> = Vec::new();
    for ((group, rest), value) in figures {
        let figure = Figure::read(rest, value);
        match groups.iter_mut().find(|(own, _)| *own == group) {
            Some((_, figures)) => figures.push(figure),
            None => groups.push((group, vec![figure])),
        }
    }
    // A stable sort: other groups keep their order.
    groups.sort_by_key(|(group, _)| GROUPS.iter().position(|(own, _)| own == group).unwrap_or(GROUPS.len()));
    let mut section = format!("{BEGIN}\n{}{}.\n", facts[..1].to_uppercase(), &facts[1..]);
    for (group, figures) in &groups {
        let title = GROUPS.iter().find(|(own, _)| own == group).map_or(*group, |(_, title)| title);
        let table = table(figures);
        let _ = if table.row_count() > ROWS {
            write!(section, "\n<details><summary>{title}</summary>\n\n{table}\n\n</details>\n")
        } else {
            write!(section, "\n{title}:\n\n{table}\n")
        };
    }
    let _ = write!(section, "\n{END}");
    Ok(section)
}

/// `page` with its section replaced by `section`.
///
/// # Errors
/// The mark that is missing.
pub fn replaced(page: &str, section: &str) -> Result<String, String> {
    let missing = |mark: &str| format!("book/src/speed.md has no line {mark}");
    let (before, rest) = page.split_once(BEGIN).ok_or_else(|| missing(BEGIN))?;
    let (_, after) = rest.split_once(END).ok_or_else(|| missing(END))?;
    Ok(format!("{before}{section}{after}"))
}
