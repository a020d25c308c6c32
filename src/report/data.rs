//! The data of a page: what its script draws, as columns in base64.

use super::intervals::Bar;
use super::page::Run;
use super::recording::{InputTrack, Quantity, SensorTrack, mounted_attitude};
use super::trace::{Columns, Samples, Trace};
use crate::health::{FilterHealth, State};
use crate::present::{Unit, residual_rows};
use crate::run::Summary;
use fusion_core::geometry::so3;
use fusion_models::earth::LocalFrame;
use nalgebra::Vector3;
use serde::Serialize;

/// Bytes of numbers in a page; base64 makes four of three.
const BUDGET: usize = 2_700_000;
/// Buckets per series where the budget allows, and the fewest that are drawn.
const BUCKETS: (usize, usize) = (8192, 64);

/// Everything that is drawn.
#[derive(Serialize)]
pub(super) struct Data {
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
    /// Parts of the map to enlarge: title, middle north and east, extent \[m\].
    details: Vec<(String, [f64; 2], f64)>,
    /// The heading that a controller wanted, from each time on \[deg\].
    wanted: TableData,
    /// From, to and state of the design's own filter, where it was coasting or worse.
    health: Vec<(f64, f64, &'static str)>,
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
    /// From the estimate to the fix: used, rejected \[m\].
    apart: TableData,
    /// The series, and the bars of its histogram; empty for a regular sensor.
    intervals: TableData,
    bars: Vec<Bar>,
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

    /// A sensor's updates, the innovations in `units`; without their 3σ and the power of the gate
    /// where there is no room for bands.
    fn of_updates(sensor: &SensorTrack, capacity: usize, units: &[&Unit], bands: bool) -> Self {
        let mut columns = sensor.updates.columns(capacity, true);
        columns.values.truncate(drawn(sensor, bands));
        let rows = columns.values.iter_mut().skip(SensorTrack::JUDGED);
        for (column, unit) in rows.zip(units.iter().cycle()) {
            column.iter_mut().for_each(|v| *v = unit.of(f64::from(*v)) as f32);
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
    SensorTrack::JUDGED + sensor.rows * if bands { 4 } else { 2 }
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
            let extra = r.sensors.iter().flat_map(|s| [&s.apart, &s.intervals.series]);
            let series = series + extra.map(|t| t.rows(capacity) * (8 + 4 * t.channels())).sum::<usize>();
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

/// What is drawn of `runs`.
pub(super) fn data(runs: &[Run<'_>]) -> Data {
    let spans = runs.iter().filter_map(|r| r.recording.span());
    let span = spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 1.0));
    let share = Share {
        capacity: capacity(runs),
        bands: runs.len() == 1,
        origin: runs.iter().find_map(|r| r.recording.origin()),
    };
    Data {
        span,
        runs: runs.iter().map(|run| share.run(run)).collect(),
    }
}

/// What all runs of a page have in common.
struct Share {
    /// Buckets per series.
    capacity: usize,
    /// Whether innovations have their 3σ.
    bands: bool,
    /// Runs whose first positions differ still share one map.
    origin: Option<LocalFrame>,
}

impl Share {
    fn run(&self, run: &Run<'_>) -> RunData {
        let r = run.recording;
        let shift = match (self.origin, r.origin()) {
            (Some(common), Some(own)) => common.to_ned(&own.origin()),
            _ => Vector3::zeros(),
        };
        const NED: [&str; 3] = ["North", "East", "Down"];
        const RPY: [&str; 3] = ["Roll", "Pitch", "Yaw"];
        let mut attitude = r.attitude.clone();
        let score = run.summary.score.as_ref();
        if let Some(mounting) = score.and_then(|s| s.mounting_deg).filter(|_| !r.mounted.is_empty()) {
            let [roll, pitch, yaw] = mounting.map(f64::to_radians);
            (attitude.truth, attitude.error) = mounted_attitude(&r.mounted, &so3::from_rpy(roll, pitch, yaw));
        }
        let none = Vector3::zeros();
        let points = |samples: &Samples<2>| TableData::of_samples(samples, self.capacity, &shift);
        let sensors = r.sensors.iter().filter(|s| !s.updates.is_empty());
        RunData {
            name: run.name.to_owned(),
            quantities: [
                self.quantity(&r.position, &shift, ("Position", "m"), NED, [false; 3]),
                self.quantity(&r.velocity, &none, ("Velocity", "m/s"), NED, [false; 3]),
                self.quantity(&attitude, &none, ("Attitude", "deg"), RPY, [false, false, true]),
            ],
            path: points(&r.path),
            true_path: points(&r.true_path),
            sensors: sensors.map(|s| self.sensor(s, run.summary, &shift)).collect(),
            inputs: r.inputs.iter().filter(|i| !i.trace.is_empty()).map(|i| self.input(i)).collect(),
            details: r.details.iter().map(|d| (d.title.clone(), d.centre.si(), d.size.si())).collect(),
            wanted: wanted(run.summary),
            health: ill_health(run.summary),
            outages: run.summary.score.iter().flat_map(|s| &s.drift).map(|d| (d.from, d.to)).collect(),
        }
    }

    fn quantity(
        &self,
        q: &Quantity,
        shift: &Vector3<f64>,
        (name, unit): (&'static str, &'static str),
        axes: [&'static str; 3],
        angles: [bool; 3],
    ) -> QuantityData {
        let turns = q.turns.unwrap_or_default();
        QuantityData {
            name,
            unit,
            axes,
            angles,
            estimate: TableData::of_trace(&q.estimate, self.capacity, (shift + turns).as_slice(), true),
            truth: TableData::of_trace(&q.truth, self.capacity, shift.as_slice(), true),
            error: TableData::of_trace(&q.error, self.capacity, &[], true),
        }
    }

    fn sensor(&self, s: &SensorTrack, summary: &Summary, shift: &Vector3<f64>) -> SensorData {
        let statistics = summary.sensors.iter().find(|t| t.name == s.name);
        let mut rows = statistics.map(residual_rows).unwrap_or_default();
        // A recording made by hand may have no statistics of its sensors, and no units with them.
        rows.truncate(s.rows);
        rows.extend((rows.len()..s.rows).map(|k| ((k + 1).to_string(), Unit::none())));
        let units: Vec<&Unit> = rows.iter().map(|(_, unit)| unit).collect();
        let irregular = s.intervals.is_irregular();
        SensorData {
            name: s.name.clone(),
            dof: statistics.and_then(|t| t.nis).map(|n| n.dof),
            gated: s.gated,
            own_statistic: s.own_statistic,
            updates: TableData::of_updates(s, self.capacity, &units, self.bands),
            used: TableData::of_samples(&s.fixes[0], self.capacity, shift),
            rejected: TableData::of_samples(&s.fixes[1], self.capacity, shift),
            apart: TableData::of_trace(&s.apart, self.capacity, &[], false),
            intervals: if irregular {
                TableData::of_trace(&s.intervals.series, self.capacity, &[], false)
            } else {
                TableData::default()
            },
            bars: if irregular { s.intervals.bars() } else { Vec::new() },
            rows: rows.iter().map(|(name, unit)| unit.beside(name)).collect(),
        }
    }

    fn input(&self, i: &InputTrack) -> InputData {
        InputData {
            name: i.name.clone(),
            unit: i.unit.clone(),
            angle: i.is_angle(),
            table: TableData::of_trace(&i.trace, self.capacity, &[], true),
        }
    }
}

/// The heading that a controller wanted \[deg\]; not a number where it wanted none.
fn wanted(summary: &Summary) -> TableData {
    let headings = summary.control.iter().flat_map(|record| &record.headings);
    let (time, degrees) = headings.map(|(t, h)| (*t, h.map_or(f32::NAN, |h| h.to_degrees() as f32))).unzip();
    TableData::of(&Columns {
        time,
        values: vec![degrees],
    })
}

/// When the design's own filter was coasting, degraded or lost.
fn ill_health(summary: &Summary) -> Vec<(f64, f64, &'static str)> {
    let spells = summary.health.first().map(FilterHealth::spells).unwrap_or_default();
    let ill = spells.into_iter().filter(|s| s.state >= State::Coasting);
    ill.map(|s| (s.from, s.to, s.state.word())).collect()
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
    use crate::observe::{Innovations, SensorStatistics};
    use crate::report::{Frame, Recording};
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
            power: &[],
            weight: 1.0,
        };
        recording.measurement("tilt", Time::default(), None, &update);
        let innovations = Innovations {
            axis: &["x", "y"],
            unit: vec!["rad".to_owned(); 2],
            ..Innovations::default()
        };
        let statistics = SensorStatistics {
            name: "tilt".to_owned(),
            innovations,
            ..SensorStatistics::default()
        };
        let summary = Summary {
            sensors: vec![statistics],
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
        assert_eq!(alone.updates.c.len(), 5 + 4 * 2);
        assert_eq!(alone.updates.c[5..7], [stored(0.1), stored(0.2)]);
        assert_eq!(alone.updates.c[9..11], [stored(3.0 * 0.1), stored(3.0 * 0.1)]);
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
