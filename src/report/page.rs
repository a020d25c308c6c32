//! The page: data as base64 columns, tables, and the script that draws.

use super::recording::{InputTrack, Quantity, Recording, SensorTrack, mounted_attitude};
use super::tables;
use super::trace::{Columns, Samples, Trace};
use crate::run::Summary;
use crate::tally::residual_rows;
use fusion_core::geometry::so3;
use nalgebra::Vector3;
use serde::Serialize;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// Bytes of numbers in a page; base64 makes four of three.
const BUDGET: usize = 3_300_000;
/// Buckets per series where the budget allows, and the fewest that are drawn.
const BUCKETS: (usize, usize) = (8192, 64);

/// One run of a report.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// What the page calls it.
    pub name: &'a str,
    /// What is drawn.
    pub recording: &'a Recording,
    /// What is tabulated.
    pub summary: &'a Summary,
}

/// Writes the report of `runs` on the same data to `path`.
///
/// # Errors
/// What the file system reports.
pub fn write(path: &Path, title: &str, runs: &[Run<'_>]) -> io::Result<()> {
    std::fs::write(path, render(title, runs))
}

/// The page as text.
#[must_use]
pub fn render(title: &str, runs: &[Run<'_>]) -> String {
    let data = serde_json::to_string(&data(runs)).unwrap_or_default();
    let mut page = String::with_capacity(data.len() + 200_000);
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        r#"<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<script>{prelude}</script>
<style>{uplot_css}
{css}</style>
</head>
<body>
<header><h1>{title}</h1>
{header}</header>
<main>
{tables}
<div id="plots"><noscript><p>The plots need JavaScript; the tables do not.</p></noscript></div>
{details}
</main>
<footer><p>Drag over a plot to zoom all of them in time, double-click to reset; on a touch screen pinch. Positions are local north, east, down. Long series are drawn by their extremes; a band much wider than the curves leaves its plot. Innovations are scaled to those accepted: one that was rejected, or readopted against the estimate, is a cross, at the edge where it lies beyond.</p></footer>
<script type="application/json" id="data">{data}</script>
<script>{uplot}</script>
<script>{script}</script>
</body>
</html>
"#,
        title = escape(title),
        header = tables::header(title, runs),
        tables = tables::overview(runs),
        details = tables::details(runs),
        uplot_css = include_str!("vendor/uPlot.min.css"),
        css = include_str!("report.css"),
        prelude = include_str!("prelude.js"),
        uplot = include_str!("vendor/uPlot.iife.min.js"),
        script = include_str!("report.js"),
        // No markup can begin inside the data.
        data = data.replace('<', "\\u003c"),
    );
    page
}

/// Text for HTML content and quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

#[derive(Serialize)]
struct Data {
    /// First and last time \[s\].
    span: (f64, f64),
    runs: Vec<RunData>,
}

#[derive(Serialize)]
struct RunData {
    name: String,
    quantities: [QuantityData; 3],
    path: TableData,
    true_path: TableData,
    sensors: Vec<SensorData>,
    inputs: Vec<InputData>,
    outages: Vec<(f64, f64)>,
}

#[derive(Serialize)]
struct QuantityData {
    name: &'static str,
    unit: &'static str,
    axes: [&'static str; 3],
    angles: [bool; 3],
    estimate: TableData,
    truth: TableData,
    error: TableData,
}

#[derive(Serialize)]
struct SensorData {
    name: String,
    dof: Option<usize>,
    gated: bool,
    own_statistic: bool,
    /// Each residual row that is drawn, `north [m]`.
    rows: Vec<String>,
    updates: TableData,
    used: TableData,
    rejected: TableData,
}

#[derive(Serialize)]
struct InputData {
    name: String,
    unit: String,
    angle: bool,
    table: TableData,
}

/// Columns in base64: times as little-endian f64, values as f32.
#[derive(Default, Serialize)]
struct TableData {
    t: String,
    c: Vec<String>,
}

impl TableData {
    fn of(columns: &Columns) -> Self {
        let t = base64(columns.time.iter().flat_map(|t| t.to_le_bytes()));
        let c = columns
            .values
            .iter()
            .map(|c| base64(c.iter().flat_map(|v| v.to_le_bytes())))
            .collect();
        Self { t, c }
    }

    /// Every n-th sample such that no more than `capacity` remain, moved by `shift`.
    fn of_samples<const N: usize>(samples: &Samples<N>, capacity: usize, shift: &Vector3<f64>) -> Self {
        let count = samples.iter().count();
        let every = count.div_ceil(capacity.max(2)).max(1);
        let kept = samples.iter().enumerate().filter(|(i, _)| i % every == 0 || i + 1 == count);
        let mut columns = Columns {
            time: Vec::new(),
            values: vec![Vec::new(); N],
        };
        for (_, (t, row)) in kept {
            columns.time.push(t);
            row.iter()
                .zip(shift.iter())
                .zip(&mut columns.values)
                .for_each(|((v, s), c)| c.push((v + s) as f32));
        }
        Self::of(&columns)
    }

    /// A sensor's updates, the innovations times `factors`; without their 3σ where there is no
    /// room for bands.
    fn of_updates(sensor: &SensorTrack, capacity: usize, factors: &[f64], bands: bool) -> Self {
        let mut columns = sensor.updates.columns(capacity, true);
        columns.values.truncate(drawn(sensor, bands));
        let rows = columns.values.iter_mut().skip(SensorTrack::JUDGED);
        for (column, factor) in rows.zip(factors.iter().cycle()) {
            column.iter_mut().for_each(|v| *v = (f64::from(*v) * factor) as f32);
        }
        Self::of(&columns)
    }

    fn of_trace(trace: &Trace, capacity: usize, shift: &[f64], breaks: bool) -> Self {
        let mut columns = trace.columns(capacity, breaks);
        for (column, shift) in columns.values.iter_mut().zip(shift).filter(|(_, s)| **s != 0.0) {
            column.iter_mut().for_each(|v| *v = (f64::from(*v) + shift) as f32);
        }
        Self::of(&columns)
    }
}

/// Channels of a sensor's updates in the page.
const fn drawn(sensor: &SensorTrack, bands: bool) -> usize {
    SensorTrack::JUDGED + sensor.rows * if bands { 3 } else { 2 }
}

/// Buckets per series such that the page keeps its budget.
fn capacity(runs: &[Run<'_>]) -> usize {
    let bytes = |capacity: usize| -> usize {
        let all = runs.iter().map(|r| r.recording);
        all.map(|r| {
            let quantities = [&r.position, &r.velocity, &r.attitude];
            let traces = quantities.into_iter().flat_map(|q| [&q.estimate, &q.truth, &q.error]);
            let traces = traces.chain(r.inputs.iter().map(|i| &i.trace)).map(|t| (t, t.channels()));
            let updates = r.sensors.iter().map(|s| (&s.updates, drawn(s, runs.len() == 1)));
            let series: usize = traces.chain(updates).map(|(t, n)| t.rows(capacity) * (8 + 4 * n)).sum();
            let mounted = r.mounted.iter().count().min(capacity) * (9 * 4 + 2 * 8);
            let points = |n: usize, width: usize| n.min(capacity + 1) * (8 + 4 * width);
            let fixes = r.sensors.iter().flat_map(|s| &s.fixes).map(|f| points(f.iter().count(), 3));
            let paths = [&r.path, &r.true_path].map(|p| points(p.iter().count(), 2));
            series + mounted + fixes.chain(paths).sum::<usize>()
        })
        .sum()
    };
    let mut capacity = BUCKETS.0;
    while capacity > BUCKETS.1 && bytes(capacity) > BUDGET {
        capacity = capacity * 7 / 8;
    }
    capacity
}

fn data(runs: &[Run<'_>]) -> Data {
    let capacity = capacity(runs);
    let spans = runs.iter().filter_map(|r| r.recording.span());
    let span = spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 1.0));
    let origin = runs.iter().find_map(|r| r.recording.origin());
    let run = |run: &Run<'_>| {
        let r = run.recording;
        // Runs whose first positions differ still share one map.
        let shift = match (origin, r.origin()) {
            (Some(common), Some(own)) => common.to_ned(&own.origin()),
            _ => Vector3::zeros(),
        };
        let sensor = |s: &SensorTrack| {
            let tally = run.summary.sensors.iter().find(|t| t.name == s.name);
            let mut rows = tally.map(residual_rows).unwrap_or_default();
            // A recording made by hand may have no tally, and no units with it.
            rows.truncate(s.rows);
            rows.extend((rows.len()..s.rows).map(|k| ((k + 1).to_string(), 1.0)));
            let (rows, factors): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
            SensorData {
                name: s.name.clone(),
                dof: tally.and_then(|t| t.nis).map(|n| n.dof),
                gated: s.gated,
                own_statistic: s.own_statistic,
                rows,
                updates: TableData::of_updates(s, capacity, &factors, runs.len() == 1),
                used: TableData::of_samples(&s.fixes[0], capacity, &shift),
                rejected: TableData::of_samples(&s.fixes[1], capacity, &shift),
            }
        };
        let input = |i: &InputTrack| InputData {
            name: i.name.clone(),
            unit: i.unit.clone(),
            angle: i.is_angle(),
            table: TableData::of_trace(&i.trace, capacity, &[], true),
        };
        let quantity = |q: &Quantity, shift: &Vector3<f64>, name, unit, axes, angles| {
            let turns = q.turns.unwrap_or_default();
            QuantityData {
                name,
                unit,
                axes,
                angles,
                estimate: TableData::of_trace(&q.estimate, capacity, (shift + turns).as_slice(), true),
                truth: TableData::of_trace(&q.truth, capacity, shift.as_slice(), true),
                error: TableData::of_trace(&q.error, capacity, &[], true),
            }
        };
        const NED: [&str; 3] = ["North", "East", "Down"];
        let mut attitude = r.attitude.clone();
        if let Some(mounting) = run
            .summary
            .score
            .as_ref()
            .and_then(|s| s.mounting_deg)
            .filter(|_| !r.mounted.is_empty())
        {
            let [roll, pitch, yaw] = mounting.map(f64::to_radians);
            (attitude.truth, attitude.error) = mounted_attitude(&r.mounted, &so3::from_rpy(roll, pitch, yaw));
        }
        let none = Vector3::zeros();
        RunData {
            name: run.name.to_owned(),
            quantities: [
                quantity(&r.position, &shift, "Position", "m", NED, [false; 3]),
                quantity(&r.velocity, &none, "Velocity", "m/s", NED, [false; 3]),
                quantity(&attitude, &none, "Attitude", "deg", ["Roll", "Pitch", "Yaw"], [false, false, true]),
            ],
            path: TableData::of_samples(&r.path, capacity, &shift),
            true_path: TableData::of_samples(&r.true_path, capacity, &shift),
            sensors: r.sensors.iter().filter(|s| !s.updates.is_empty()).map(sensor).collect(),
            inputs: r.inputs.iter().filter(|i| !i.trace.is_empty()).map(input).collect(),
            outages: run.summary.score.iter().flat_map(|s| &s.drift).map(|d| (d.from, d.to)).collect(),
        }
    };
    Data {
        span,
        runs: runs.iter().map(run).collect(),
    }
}

/// RFC 4648, padded.
fn base64(bytes: impl Iterator<Item = u8>) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    let mut bytes = bytes.peekable();
    while bytes.peek().is_some() {
        let three: [Option<u8>; 3] = std::array::from_fn(|_| bytes.next());
        let word = three.iter().fold(0_u32, |w, b| w << 8 | u32::from(b.unwrap_or(0)));
        for digit in 0..4 {
            let wanted = digit == 0 || three[digit - 1].is_some();
            let value = (word >> (18 - 6 * digit)) & 63;
            out.push(if wanted { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Frame;
    use crate::tally::{Innovations, SensorTally};
    use fusion_core::filter::{Update, Verdict};
    use fusion_core::gate::Mode;
    use fusion_core::time::Time;

    #[test]
    fn innovations_have_the_names_and_units_of_the_tables_and_a_band_where_a_run_is_alone() {
        let mut recording = Recording::new(Frame::default());
        let update = Update {
            verdict: Verdict::Accepted,
            value: &[],
            predicted: &[],
            noise: &[],
            residual: &[0.1, 0.2],
            innovation_sigma: &[0.1, 0.1],
            nis: 5.0,
            statistic: 5.0,
            threshold: f64::INFINITY,
            mode: Mode::Track,
            weight: 1.0,
        };
        recording.measurement("tilt", Time::default(), None, &update);
        let innovations = Innovations {
            axis: &["x", "y"],
            unit: vec!["rad".to_owned(); 2],
            ..Innovations::default()
        };
        let tally = SensorTally {
            name: "tilt".to_owned(),
            innovations,
            ..SensorTally::default()
        };
        let summary = Summary {
            sensors: vec![tally],
            ..Summary::default()
        };
        let run = Run {
            name: "a",
            recording: &recording,
            summary: &summary,
        };
        // 0.1 rad is kept as f32 before it is turned into degrees.
        let stored = |rad: f64| base64((f64::from(rad as f32).to_degrees() as f32).to_le_bytes().into_iter());
        let data = data(&[run]);
        let alone = &data.runs[0].sensors[0];
        assert_eq!(alone.rows, ["x [deg]", "y [deg]"]);
        assert_eq!(alone.updates.c.len(), 5 + 3 * 2);
        assert_eq!(alone.updates.c[5..7], [stored(0.1), stored(0.2)]);
        assert_eq!(alone.updates.c[9..], [stored(3.0 * 0.1), stored(3.0 * 0.1)]);
        let both = super::data(&[run, run]);
        assert!(both.runs.iter().all(|r| r.sensors[0].updates.c.len() == 5 + 2 * 2));
    }

    #[test]
    fn base64_gives_the_vectors_of_rfc_4648() {
        for (text, encoded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(text.bytes()), encoded);
        }
        assert_eq!(base64([0xfb, 0xff].into_iter()), "+/8=");
    }
}
