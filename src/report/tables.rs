//! The numbers of a report, as tables that read without a script.

use super::page::{Run, escape};
use crate::score::{Axes, Consistency, Score};
use crate::table::readable;
use crate::tally::{Count, SensorTally, counts, residual_rows};
use std::fmt::Write as _;

/// Below this share of errors inside 3σ (0.997 for a consistent filter) the cell is marked.
const FEW_INSIDE: f64 = 0.98;

/// A number with three significant digits.
fn number(v: f64) -> String {
    let size = v.abs();
    match size {
        _ if !v.is_finite() => "–".to_owned(),
        _ if size == 0.0 => "0".to_owned(),
        _ if !(5e-4..1e6).contains(&size) => format!("{v:.2e}"),
        _ => {
            let decimals = (2.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
            format!("{v:.decimals$}")
        }
    }
    .replace('-', "−")
}

fn count(n: u64) -> String {
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

/// A table with a caption; `rows` are cells of finished HTML, the first of each its heading.
fn table(caption: &str, head: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = format!("<div class=\"table\"><table><caption>{caption}</caption><thead><tr>");
    head.iter().for_each(|h| out.extend(["<th scope=\"col\">", h, "</th>"]));
    out.push_str("</tr></thead><tbody>");
    for row in rows {
        out.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            out.extend(if i == 0 {
                ["<th scope=\"row\">", cell, "</th>"]
            } else {
                ["<td>", cell, "</td>"]
            });
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>\n");
    out
}

/// What the runs are, under the title.
pub(super) fn header(title: &str, runs: &[Run<'_>]) -> String {
    let mut out = String::new();
    let mut seen = vec![title];
    for run in runs {
        let text = run.summary.description.as_str();
        if !text.is_empty() && !seen.contains(&text) {
            let _ = writeln!(out, "<p>{}</p>", escape(text));
            seen.push(text);
        }
    }
    let mut backends: Vec<&str> = runs.iter().map(|r| r.summary.backend.as_str()).collect();
    backends.dedup();
    if let [backend] = backends[..]
        && !backend.is_empty()
    {
        let _ = writeln!(out, "<p>Backend: {}</p>", escape(backend));
    }
    out
}

/// The result: a row for each run.
pub(super) fn overview(runs: &[Run<'_>]) -> String {
    let scores: Vec<&Score> = runs
        .iter()
        .filter_map(|r| r.summary.score.as_ref())
        .filter(|s| s.epochs > 0)
        .collect();
    let has = |f: &dyn Fn(&Score) -> bool| scores.iter().any(|s| f(s));
    let mut head = vec!["Run"];
    let mut cells: Vec<fn(&Score) -> Option<f64>> = Vec::new();
    let mut column = |name: &'static str, cell: fn(&Score) -> Option<f64>| {
        head.push(name);
        cells.push(cell);
    };
    if has(&|s| s.position.is_some()) {
        column("horizontal RMS [m]", |s| s.position.map(|_| s.horizontal_rms));
        column("horizontal max [m]", |s| s.position.map(|_| s.horizontal_max));
        column("height RMS [m]", |s| s.position.map(|p| p.rms[2]));
    }
    if has(&|s| s.velocity.is_some()) {
        column("velocity RMS [m/s]", |s| {
            s.velocity.map(|v| v.rms.iter().map(|r| r * r).sum::<f64>().sqrt())
        });
    }
    if has(&|s| s.attitude_deg.is_some()) {
        column("tilt RMS [deg]", |s| s.attitude_deg.map(|a| a.rms[0].hypot(a.rms[1])));
        column("yaw RMS [deg]", |s| s.attitude_deg.map(|a| a.rms[2]));
    }
    if has(&|s| s.drift_rms.is_some()) {
        column("outage RMS [m]", |s| s.drift_rms);
    }
    head.extend(["estimates", "rejected"]);
    let differ = runs.windows(2).any(|w| w[0].summary.backend != w[1].summary.backend);
    if differ {
        head.push("backend");
    }
    let rows: Vec<Vec<String>> = runs
        .iter()
        .map(|run| {
            let s = run.summary;
            let rejected = s.sensors.iter().map(|t| t.rejected).sum::<u64>();
            let tail = [count(s.epochs), count(rejected)]
                .into_iter()
                .chain(differ.then(|| escape(&s.backend)));
            std::iter::once(escape(run.name))
                .chain(
                    cells
                        .iter()
                        .map(|c| s.score.as_ref().and_then(c).map_or_else(|| "–".to_owned(), number)),
                )
                .chain(tail)
                .collect()
        })
        .collect();
    let mut out = String::from("<section id=\"result\"><h2>Result</h2>\n");
    out.push_str(&table(
        if scores.is_empty() {
            "No reference to score against"
        } else {
            "Errors against the reference"
        },
        &head,
        &rows,
    ));
    for run in runs {
        for warning in run.summary.warnings() {
            let _ = writeln!(
                out,
                "<p class=\"warning\"><strong>{}</strong>: {}</p>",
                escape(run.name),
                escape(&warning)
            );
        }
    }
    out.push_str("</section>\n");
    out
}

/// Everything else the summaries hold, run by run.
pub(super) fn details(runs: &[Run<'_>]) -> String {
    let mut out = String::from("<section id=\"numbers\"><h2>Numbers</h2>\n");
    for run in runs {
        if runs.len() > 1 {
            let _ = writeln!(out, "<h3>{}</h3>", escape(run.name));
        }
        let s = run.summary;
        if let Some(score) = &s.score {
            out.push_str(&errors(score));
            out.push_str(&drift(score));
        }
        if !s.sensors.is_empty() {
            let counts = counts(&s.sensors);
            let rows: Vec<_> = s.sensors.iter().map(|t| sensor(t, &counts)).collect();
            let head: Vec<&str> = ["Sensor"]
                .into_iter()
                .chain(counts.iter().map(|(title, _)| *title))
                .chain(["expected NIS", "mean NIS", "95 % band", "verdict"])
                .collect();
            out.push_str(&table(
                "Measurements; a mean NIS above its band says that the filter trusts itself too much",
                &head,
                &rows,
            ));
            out.push_str(&refusals(&s.sensors));
            out.push_str(&innovations(&s.sensors));
        }
        if !s.parameters.is_empty() {
            let row = |p: &crate::run::FinalState| {
                let (factor, unit) = readable(p.unit);
                let list = |v: &[f64]| v.iter().map(|v| number(v * factor)).collect::<Vec<_>>().join(", ");
                vec![escape(&p.name), list(&p.value), list(&p.sigma), escape(&unit)]
            };
            let rows: Vec<_> = s.parameters.iter().map(row).collect();
            out.push_str(&table(
                "Estimated parameters at the end",
                &["Parameter", "value", "1σ", "unit"],
                &rows,
            ));
        }
        if !s.sources.is_empty() {
            let row = |t: &crate::run::SourceTally| {
                let skipped = t.skipped.iter().map(|(why, n)| format!("{} × {}", count(*n), escape(why)));
                vec![
                    escape(&t.name),
                    count(t.rows),
                    count(t.used),
                    skipped.collect::<Vec<_>>().join(", "),
                ]
            };
            let rows: Vec<_> = s.sources.iter().map(row).collect();
            out.push_str(&table("Data", &["Source", "rows", "used", "left out"], &rows));
        }
        for failure in &s.failures {
            let _ = writeln!(out, "<p class=\"warning\">{}</p>", escape(failure));
        }
    }
    out.push_str("</section>\n");
    out
}

fn errors(score: &Score) -> String {
    const NED: [&str; 3] = ["north", "east", "down"];
    let groups: [(&str, &str, [&str; 3], Option<Axes>); 3] = [
        ("position", "m", NED, score.position),
        ("velocity", "m/s", NED, score.velocity),
        ("attitude", "deg", ["roll", "pitch", "yaw"], score.attitude_deg),
    ];
    let mut rows = Vec::new();
    for (name, unit, axes, values) in groups {
        let Some(v) = values else { continue };
        for (i, axis) in axes.iter().enumerate() {
            let inside = format!("{:.1} %", 100.0 * v.inside[i]);
            let inside = if v.inside[i] < FEW_INSIDE {
                format!("<strong class=\"bad\">{inside}</strong>")
            } else {
                inside
            };
            let mut row = vec![format!("{name} {axis} [{unit}]")];
            row.extend([v.rms[i], v.max[i], v.mean[i], v.three_sigma[i]].map(number));
            row.push(inside);
            rows.push(row);
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    let mut out = table("Errors per axis", &["Axis", "RMS", "max", "mean", "mean 3σ", "inside 3σ"], &rows);
    let nees = [
        ("position", score.nees_position),
        ("velocity", score.nees_velocity),
        ("attitude", score.nees_attitude),
    ];
    let rows: Vec<Vec<String>> = nees
        .into_iter()
        .filter_map(|(name, c)| {
            let c = c?;
            Some(vec![name.to_owned(), c.dof.to_string(), number(c.mean), band(&c), verdict(&c)])
        })
        .collect();
    if !rows.is_empty() {
        out.push_str(&table(
            "Consistency: normalised error squared",
            &["NEES", "expected", "mean", "95 % band", "verdict"],
            &rows,
        ));
    }
    out
}

fn drift(score: &Score) -> String {
    /// Outages listed one by one.
    const LISTED: usize = 40;
    let row = |d: &crate::score::Drift| {
        let span = format!("{} – {}", number_of_time(d.from), number_of_time(d.to));
        vec![span, number(d.to - d.from), number(d.max_horizontal), number(d.growth)]
    };
    let mut rows: Vec<_> = score.drift.iter().take(LISTED).map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    if score.drift.len() > LISTED {
        rows.push(vec![
            format!("and {} more", score.drift.len() - LISTED),
            String::new(),
            String::new(),
            String::new(),
        ]);
    }
    let head = ["Outage [s]", "duration [s]", "largest horizontal error [m]", "growth [m]"];
    table("Outages", &head, &rows)
}

fn number_of_time(t: f64) -> String {
    format!("{:.1}", t)
}

fn sensor(t: &SensorTally, counts: &[(&str, Count)]) -> Vec<String> {
    let mut row = vec![escape(&t.name)];
    row.extend(counts.iter().map(|(_, of)| of(t).map_or_else(|| "–".to_owned(), count)));
    match &t.nis {
        Some(c) => row.extend([c.dof.to_string(), number(c.mean), band(c), verdict(c)]),
        None => row.extend(std::iter::repeat_n("–".to_owned(), 4)),
    }
    row
}

fn refusals(sensors: &[SensorTally]) -> String {
    let row = |t: &SensorTally| {
        let r = t.longest_refusal?;
        let end = if t.ends_denied { "denied" } else { "" };
        let times = [r.from, r.seconds].map(number_of_time);
        Some(
            [escape(&t.name), count(r.measurements)]
                .into_iter()
                .chain(times)
                .chain([end.to_owned()])
                .collect(),
        )
    };
    let rows: Vec<Vec<String>> = sensors.iter().filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let head = ["Sensor", "rejected in a row", "from [s]", "for [s]", "at the end"];
    table("Longest refusals", &head, &rows)
}

fn innovations(sensors: &[SensorTally]) -> String {
    let mut rows = Vec::new();
    for t in sensors.iter().filter(|t| t.innovations.count > 0) {
        for (k, (row, factor)) in residual_rows(t).into_iter().enumerate() {
            let (rms, max) = (t.innovations.rms[k] * factor, t.innovations.max[k] * factor);
            rows.push(vec![escape(&format!("{} {row}", t.name)), number(rms), number(max)]);
        }
    }
    if rows.is_empty() {
        return String::new();
    }
    let caption = "Innovations of accepted measurements: sensor minus navigation, before each was used";
    table(caption, &["Residual", "RMS", "max"], &rows)
}

fn band(c: &Consistency) -> String {
    format!("{} – {}", number(c.band.0), number(c.band.1))
}

fn verdict(c: &Consistency) -> String {
    let text = if c.is_consistent() {
        return "consistent".to_owned();
    } else if c.mean > c.band.1 {
        "overconfident"
    } else {
        "too cautious"
    };
    format!("<strong class=\"bad\">{text}</strong>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let shown = [0.0, 1234.56, 12.345, 0.0057, -0.5, 1.0e-5, f64::NAN].map(number);
        assert_eq!(shown, ["0", "1235", "12.3", "0.00570", "−0.500", "1.00e−5", "–"]);
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
    }
}
