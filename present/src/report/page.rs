//! The page: headings, tables, and the script that draws the plots between them.

use super::data::data;
use super::recording::Recording;
use crate::Shown;
use crate::comparison;
use fusion::output::{FileSet, Unwritable};
use fusion::provenance::Provenance;
use fusion::run::Summary;
use fusion_tables::{Section, html::sections};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::io::Write;

/// The content security policy: the page loads nothing.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";

/// Scripts of a page, in order: each sees the names of those before it.
pub(super) type Scripts = &'static [&'static [&'static str]];

/// The scripts of every page with plots.
pub(super) const BASE: &[&str] = &[
    include_str!("script/base.js"),
    include_str!("script/time.js"),
    include_str!("script/page.js"),
];
pub(super) const OF_RUNS: Scripts = &[
    BASE,
    &[
        include_str!("script/map.js"),
        include_str!("script/motion.js"),
        include_str!("script/sensors.js"),
        include_str!("script/act.js"),
    ],
];

/// How the plots are read.
const HELP: &str = "Drag over a plot to zoom all of them in time, with Shift to zoom to an area; Ctrl and the wheel zoom time, Shift and \
    the wheel the height; double-click to reset; on a touch screen pinch. A click on a key hides its curves. Arrow keys step \
    the cursor, with Shift they move in time; + and − zoom, 0 resets. On the map, dragging zooms to an area, with Shift it \
    pans; on a map that has the focus the arrow keys pan. \
    Positions are local north, east, down. Long series are drawn by their extremes; a band much wider than the curves \
    leaves its plot. Innovations are scaled to those accepted: a rejected measurement, or one that re-acquired the \
    sensor, is a cross, at the edge of the plot where it lies beyond. Intervals are drawn of sensors that are not regular.";

/// One run of a report.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Its name on the page.
    pub name: &'a str,
    /// The data to draw.
    pub recording: &'a Recording,
    /// The figures for the tables.
    pub summary: &'a Summary,
}

/// Writes the report of `runs` on the same data as report.html among the files of `set`.
///
/// # Errors
/// Where it cannot be written.
pub fn write(set: &mut FileSet, title: &str, runs: &[Run<'_>]) -> Result<(), Unwritable> {
    let title = if title.is_empty() { "fusion" } else { title };
    set.write("report.html", |file| file.write_all(render(title, runs).as_bytes()))
}

/// The page as text.
#[must_use]
pub fn render(title: &str, runs: &[Run<'_>]) -> String {
    let data = serde_json::to_string(&data(runs)).unwrap_or_default();
    let main = html! {
        section #result { h2 { "Result" } (result(runs)) (warnings(runs)) }
        div #plots { noscript { p { "The plots need JavaScript; the tables do not." } } }
        section #numbers { h2 { "Numbers" } (numbers(runs)) }
    };
    shell(title, &descriptions(title, runs), &main, HELP, &data, OF_RUNS)
}

/// A page around `main`, with the `data` that `scripts` draw.
pub(super) fn shell(title: &str, described: &Markup, main: &Markup, help: &str, data: &str, scripts: Scripts) -> String {
    // No markup can begin inside the data.
    let data = data.replace('<', "\\u003c");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (head(title))
            body {
                header { h1 { (title) } (described) }
                main { (main) }
                footer { p { (help) } }
                script type="application/json" id="data" { (PreEscaped(data)) }
                script { (PreEscaped(include_str!("vendor/uPlot.iife.min.js"))) }
                @for text in scripts.iter().copied().flatten() { script { (PreEscaped(text)) } }
            }
        }
    };
    page.into_string()
}

fn head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (title) }
            script { (PreEscaped(include_str!("prelude.js"))) }
            style {
                (PreEscaped(include_str!("vendor/uPlot.min.css")))
                (PreEscaped(include_str!("report.css")))
            }
        }
    }
}

/// The descriptions of the runs, unless the title contains them.
fn descriptions(title: &str, runs: &[Run<'_>]) -> Markup {
    let mut shown = vec![title, ""];
    let mut lines = Vec::new();
    for run in runs {
        let text = run.summary.identity().description.as_str();
        if !shown.contains(&text) {
            shown.push(text);
            lines.push(text);
        }
    }
    let provenance = Provenance::common(runs.iter().map(|run| &run.summary.identity().provenance)).line();
    html! {
        @for line in lines { p { (line) } }
        @if !provenance.is_empty() { p.provenance { (provenance) } }
    }
}

/// Errors of one run, or of several runs next to each other.
fn result(runs: &[Run<'_>]) -> Markup {
    if runs.iter().all(|r| r.summary.score().is_none()) {
        return html! { p { "No reference to score against." } (compared(runs)) };
    }
    compared(runs)
}

fn compared(runs: &[Run<'_>]) -> Markup {
    match runs {
        [] => html! {},
        [run] => {
            let health = crate::health::section(run.summary.health());
            let shown = Shown(run.summary);
            let first = [shown.verdict(), shown.look_next(usize::MAX), health];
            let all: Vec<_> = first.into_iter().chain(shown.errors()).collect();
            sections(&all)
        }
        _ => {
            let named: Vec<_> = runs.iter().map(|r| (r.name, r.summary)).collect();
            sections(&comparison::sections(&named))
        }
    }
}

fn warnings(runs: &[Run<'_>]) -> Markup {
    html! {
        @for run in runs {
            @for warning in Shown(run.summary).warnings() {
                p.warning { strong { (run.name) } ": " (warning) }
            }
        }
    }
}

/// The other figures of the summaries, run by run.
fn numbers(runs: &[Run<'_>]) -> Markup {
    let of = |run: &Run<'_>| -> Vec<Section> {
        let s = Shown(run.summary);
        // The errors of a single run are its result, above the plots.
        let errors = if runs.len() > 1 { s.errors() } else { Vec::new() };
        let first = [s.facts()].into_iter().chain(errors);
        let further = crate::section::all(run.summary);
        first
            .chain(s.measurements())
            .chain([s.estimated(), s.data()])
            .chain(further)
            .collect()
    };
    html! {
        @for run in runs {
            @if runs.len() > 1 { h2.run { (run.name) } }
            (sections(&of(run)))
        }
    }
}
