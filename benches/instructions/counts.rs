//! The counts of a file, and a comparison of two of them.

use comfy_table::{CellAlignment, Table};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A count may grow by this fraction. A larger growth has to be noticed.
const GROWTH: f64 = 0.05;

const HEADER: &str = "\
# Instructions per step, written by `cargo bench --bench instructions -- --write`.
# They hold for this compiler and this kernel; elsewhere nothing is compared.
";

/// The counts, with the compiler and the kernel that they hold for.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    pub compiler: String,
    pub kernel: String,
    pub instructions: BTreeMap<String, u64>,
}

impl Counts {
    pub fn read(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|e| e.to_string())
    }

    pub fn text(&self) -> String {
        let table = toml::to_string(self).expect("counts are TOML");
        format!("{HEADER}\n{table}")
    }

    /// Why the counts of `other` cannot be compared with these.
    pub fn differs(&self, other: &Self) -> Option<String> {
        let pairs = [(&self.compiler, &other.compiler), (&self.kernel, &other.kernel)];
        let (own, others) = pairs.into_iter().find(|(own, others)| own != others)?;
        Some(format!("counts.toml is of {own}, here is {others}"))
    }
}

/// A row per count, with the counts that grew too much first. True if no count grew too much; a count that is missing
/// on either side also fails.
pub fn table(before: &Counts, now: &Counts) -> (String, bool) {
    let (was, is) = (&before.instructions, &now.instructions);
    let names: std::collections::BTreeSet<&String> = was.keys().chain(is.keys()).collect();
    let mut rows: Vec<(f64, &String)> = names
        .into_iter()
        .map(|name| match (was.get(name), is.get(name)) {
            (Some(&was), Some(&is)) => (is as f64 / was as f64 - 1.0, name),
            _ => (f64::INFINITY, name),
        })
        .collect();
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut table = Table::new();
    table.load_preset(comfy_table::presets::ASCII_MARKDOWN);
    table.set_header([&format!("instructions, {}", now.kernel), "was", "is", "%", ""]);
    (1..4).for_each(|k| table.column_mut(k).expect("five columns").set_cell_alignment(CellAlignment::Right));
    let number = |of: &BTreeMap<String, u64>, name: &String| of.get(name).map_or("–".to_owned(), u64::to_string);
    for (growth, name) in &rows {
        let (percent, mark) = match growth {
            g if !g.is_finite() => (String::new(), "MISSING"),
            g if *g > GROWTH => (format!("{:+.1}", 100.0 * g), "TOO MANY"),
            g => (format!("{:+.1}", 100.0 * g), ""),
        };
        table.add_row([name.as_str(), &number(was, name), &number(is, name), &percent, mark]);
    }
    let bad = rows.iter().filter(|(growth, _)| *growth > GROWTH).count();
    let fewer = rows.iter().filter(|(growth, _)| *growth < -GROWTH).count();
    let verdict = match (bad, fewer) {
        (0, 0) => format!("{} counts are within 5 % of benches/instructions/counts.toml", rows.len()),
        (0, _) => format!(
            "{fewer} of {} counts are more than 5 % lower: hold them with `cargo bench --bench instructions -- --write`",
            rows.len()
        ),
        _ => format!(
            "{bad} of {} counts grew by more than 5 % or are on one side only. If that is meant, `cargo bench --bench instructions -- --write` writes them anew",
            rows.len()
        ),
    };
    (format!("{table}\n{verdict}"), bad == 0)
}
