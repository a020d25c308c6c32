//! The page of a campaign: fans of its errors over time, NEES over its runs, and a table of its seeds.

use super::page::{BASE, Scripts, shell};
use super::table::TableData;
use super::trace::Columns;
use crate::Shown;
use fusion_core::consistency::mean_band;
use fusion_judge::campaign::{Campaign, RunRow, Together, together};
use fusion_tables::html::sections;
use maud::{Markup, html};
use serde::Serialize;

/// The quantiles of a fan, and the worst run.
const QUANTILES: [f64; 6] = [0.05, 0.25, 0.5, 0.75, 0.95, 1.0];
const SCRIPTS: Scripts = &[BASE, &[include_str!("script/campaign.js"), include_str!("script/act.js")]];

/// How a run of the campaign is looked at.
#[derive(Clone, Debug)]
pub struct Look {
    /// The command that makes its report.
    pub command: String,
    /// Its report, if it was written: a file next to the page.
    pub report: Option<String>,
}

#[derive(Serialize)]
struct Data {
    span: (f64, f64),
    fans: Vec<Fan>,
}

/// An error over time.
#[derive(Serialize)]
struct Fan {
    name: &'static str,
    unit: &'static str,
    /// The quantiles.
    table: TableData,
    /// Mean NEES over the runs, and its band.
    nees: TableData,
    dof: usize,
}

/// The page as text; `look` says how each run is looked at.
#[must_use]
pub fn render_campaign(title: &str, campaign: &Campaign, look: &dyn Fn(&RunRow) -> Look) -> String {
    let title = if title.is_empty() { "fusion montecarlo" } else { title };
    let fans: Vec<(Fan, (f64, f64))> = (0..3).filter_map(|k| fan(k, &together(&campaign.histories, k))).collect();
    let span = fans.iter().map(|(_, span)| *span).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let data = Data {
        span: span.unwrap_or((0.0, 1.0)),
        fans: fans.into_iter().map(|(fan, _)| fan).collect(),
    };
    let page = Shown(campaign).page();
    let main = html! {
        section #result {
            h2 { "Result of " (campaign.runs + campaign.failed) " runs" }
            @for warning in &page.warnings { p.warning { (warning) } }
            (sections(&page.sections))
        }
        @if campaign.runs > campaign.histories.len() && !campaign.histories.is_empty() {
            p { "The plots show the first " (campaign.histories.len()) " of " (campaign.runs) " runs." }
        }
        div #plots { noscript { p { "The plots need JavaScript; the tables do not." } } }
        section #runs { h2 { "Runs, the worst first" } (runs(campaign, look)) }
    };
    let help = "A fan shows, over the runs, the quantiles of the RMS error within short times: half of the runs lie in the dark \
                band, nine of ten in the light one. The mean NEES of a consistent filter lies in its band 95 % of the time. Drag over a \
                plot to zoom in time, double-click to reset.";
    shell(
        title,
        &html! { p.provenance { (campaign.subject.provenance.line()) } },
        &main,
        help,
        &serde_json::to_string(&data).unwrap_or_default(),
        SCRIPTS,
    )
}

fn fan(quantity: usize, bins: &[Together]) -> Option<(Fan, (f64, f64))> {
    let (first, last) = (bins.first()?, bins.last()?);
    let [name, unit] = [["Position", "m"], ["Velocity", "m/s"], ["Attitude", "deg"]][quantity];
    let scale = if quantity == 2 { 1_f64.to_degrees() } else { 1.0 };
    let values = QUANTILES.map(|share| bins.iter().map(|bin| (scale * bin.quantile(share)) as f32).collect());
    let dof = bins.iter().filter_map(|bin| bin.nees).map(|nees| nees.1).max().unwrap_or(0);
    let mut nees = Columns {
        time: Vec::new(),
        values: vec![Vec::new(); 3],
    };
    let (mut runs, mut band) = (0, (0.0, 0.0));
    for (bin, (mean, _, count)) in bins.iter().filter_map(|bin| Some((bin, bin.nees.filter(|nees| nees.1 == dof)?))) {
        if count != runs {
            (runs, band) = (count, mean_band(0.95, dof, count));
        }
        nees.time.push(bin.time);
        nees.values
            .iter_mut()
            .zip([mean, band.0, band.1])
            .for_each(|(c, v)| c.push(v as f32));
    }
    let table = Columns {
        time: bins.iter().map(|bin| bin.time).collect(),
        values: values.into(),
    };
    let fan = Fan {
        name,
        unit,
        table: TableData::of(&table),
        nees: TableData::of(&nees),
        dof,
    };
    Some((fan, (first.time, last.time)))
}

fn runs(campaign: &Campaign, look: &dyn Fn(&RunRow) -> Look) -> Markup {
    let number = |value: f64| {
        if value.is_finite() {
            format!("{value:.4}")
        } else {
            "–".to_owned()
        }
    };
    let heads = [
        "run",
        "seed",
        "position RMSE [m]",
        "rotation RMSE [deg]",
        "NEES position",
        "NEES velocity",
        "NEES attitude",
        "ill [%]",
        "drift of the way [%]",
    ];
    let (count, worst) = (campaign.runs, campaign.worst());
    html! {
        @if count > worst.len() { p { "The " (worst.len()) " worst of " (count) "; runs.csv has all of them." } }
        div.table { table {
            thead { tr { @for head in heads { th scope="col" { (head) } } @for head in ["health at worst", "its plots"] { th.text scope="col" { (head) } } } }
            tbody { @for row in worst {
                @let Look { command, report } = look(row);
                tr {
                    th scope="row" { (row.run) }
                    td { (row.seed) }
                    td { (number(row.position_rmse)) }
                    td { (number(row.rotation_rmse)) }
                    @for nees in row.nees { td { (number(nees.map_or(f64::NAN, |c| c.mean))) } }
                    td { (number(100.0 * row.health.ill)) }
                    td { (number(row.drift_percent.unwrap_or(f64::NAN))) }
                    td.text { (row.health.worst.word()) }
                    td.text.long { @if let Some(report) = report { a href=(report) { (report) } } @else { code { (command) } } }
                }
            } }
        } }
    }
}
