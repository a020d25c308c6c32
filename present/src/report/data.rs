//! The data of a page: the columns that its script draws, in base64.

use super::consistency::{Judged, Normalised, Share as Inside, band};
use super::intervals::Bar;
use super::page::Run;
use super::parameters::ParameterTrack;
use super::path::Path;
use super::recording::{InputTrack, Quantity, Recording, mounted_attitude};
use super::sensor::SensorTrack;
use super::table::TableData;
use super::trace::{Columns, Samples};
use crate::residual_rows;
use fusion::health::FilterHealth;
use fusion::run::{FaultWindow, Summary};
use fusion::score::Score;
use fusion_core::geometry::so3;
use fusion_core::health::State;
use fusion_core::math;
use fusion_models::earth::LocalFrame;
use fusion_tables::Unit;
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
    /// The least and the greatest north and east that the map shows \[m\].
    extent: [[f64; 2]; 2],
    runs: Vec<RunData>,
}

#[derive(Serialize)]
struct RunData {
    name: String,
    quantities: [QuantityData; 3],
    path: TableData,
    true_path: TableData,
    /// The rows of a sensor that were withheld, if they are the reference: they are drawn as points, not as a path.
    withheld: Option<String>,
    smoothed: Option<SmoothedData>,
    sensors: Vec<SensorData>,
    inputs: Vec<InputData>,
    parameters: Vec<ParameterData>,
    nees: Vec<NeesData>,
    /// For a run that is not the first: position, velocity and attitude minus those of the first at the same times.
    differences: TableData,
    outages: Vec<(f64, f64)>,
    /// From, to, stream and name of each declared fault.
    faults: Vec<(f64, f64, String)>,
    /// Parts of the map to enlarge: title, middle north and east, extent \[m\].
    details: Vec<(String, [f64; 2], f64)>,
    /// The heading that a controller wanted, from each time on \[deg\].
    wanted: TableData,
    /// The path that the mission asked for: the ends of each part, north and east \[m\].
    asked: Vec<[[f64; 2]; 2]>,
    /// From, to and state of the design's own filter.
    health: Vec<(f64, f64, &'static str)>,
}

/// The way and the motion of smoothed estimates, with their errors.
#[derive(Serialize)]
struct SmoothedData {
    quantities: [QuantityData; 3],
    path: TableData,
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
    nis: Option<BandData>,
    normalised: Vec<NormalisedData>,
    rejections: Option<RejectionsData>,
}

/// A parameter's axis: its value and 3σ, and the value that the simulation drew.
#[derive(Serialize)]
struct ParameterData {
    name: String,
    unit: String,
    estimate: TableData,
    truth: TableData,
}

/// The band of a statistic, and how many of its values lie inside.
#[derive(Serialize)]
struct BandData {
    dof: usize,
    low: f64,
    high: f64,
    count: u64,
    inside: u64,
}

#[derive(Serialize)]
struct NeesData {
    name: &'static str,
    band: BandData,
    table: TableData,
}

/// The normalised innovations of a row.
#[derive(Serialize)]
struct NormalisedData {
    count: u64,
    /// Density per σ in bins of a quarter, from −5.
    density: Vec<f64>,
    /// At 1, 2, … measurements.
    autocorrelation: Vec<f64>,
}

#[derive(Serialize)]
struct RejectionsData {
    judged: u64,
    rejected: u64,
    expected: f64,
}

#[derive(Serialize)]
struct InputData {
    name: String,
    unit: String,
    angle: bool,
    table: TableData,
}

/// Channels of a sensor's updates in the page.
const fn drawn(sensor: &SensorTrack, bands: bool) -> usize {
    SensorTrack::JUDGED + sensor.rows * if bands { 4 } else { 2 }
}

/// A sensor's updates, the innovations in `units`; without their 3σ and the power of the gate
/// where there is no room for bands.
fn updates(sensor: &SensorTrack, capacity: usize, units: &[&Unit], bands: bool) -> TableData {
    let mut columns = sensor.updates.columns(capacity, true);
    columns.values.truncate(drawn(sensor, bands));
    let rows = columns.values.iter_mut().skip(SensorTrack::JUDGED);
    for (column, unit) in rows.zip(units.iter().cycle()) {
        column.iter_mut().for_each(|v| *v = unit.of(f64::from(*v)) as f32);
    }
    TableData::of(&columns)
}

/// Buckets per series such that the page keeps its budget.
fn capacity(runs: &[Run<'_>]) -> usize {
    let bytes = |capacity: usize| -> usize {
        let all = runs.iter().map(|r| r.recording);
        all.map(|r| {
            let quantities = [&r.position, &r.velocity, &r.attitude];
            let traces = quantities.into_iter().flat_map(|q| [&q.estimate, &q.truth, &q.error]);
            let beside = r.smoothed.as_deref().filter(|_| runs.len() == 1);
            let quantities = beside.into_iter().flat_map(|s| [&s.position, &s.velocity, &s.attitude]);
            let traces = traces.chain(quantities.flat_map(|q| [&q.estimate, &q.error]));
            let traces = traces.chain(r.inputs.iter().map(|i| &i.trace)).map(|t| (t, t.channels()));
            let updates = r.sensors.iter().map(|s| (&s.updates, drawn(s, runs.len() == 1)));
            let series: usize = traces.chain(updates).map(|(t, n)| t.rows(capacity) * (8 + 4 * n)).sum();
            let of_mounting = [Some(r), beside].into_iter().flatten();
            let mounted = of_mounting
                .map(|r| r.mounted.iter().count().min(capacity) * (9 * 4 + 2 * 8))
                .sum::<usize>();
            let points = |n: usize, width: usize| n.min(capacity + 1) * (8 + 4 * width);
            let extra = r.sensors.iter().flat_map(|s| [&s.apart, &s.intervals.series]);
            let series = series + extra.map(|t| t.rows(capacity) * (8 + 4 * t.channels())).sum::<usize>();
            let parameters = r.parameters.tracks().flat_map(|p| [&p.estimate, &p.truth]);
            let judged = parameters.chain(r.nees.iter().map(|n| &n.series));
            let series = series + judged.map(|t| t.rows(capacity) * (8 + 4 * t.channels())).sum::<usize>();
            let series = series + if runs.len() > 1 { points(r.states.iter().count(), 9) } else { 0 };
            let fixes = r.sensors.iter().flat_map(|s| &s.fixes).map(|f| points(f.iter().count(), 3));
            let paths = [&r.path, &r.true_path].into_iter().chain(beside.map(|s| &s.path));
            let paths = paths.map(|p| points(p.points().len(), 2));
            series + mounted + fixes.sum::<usize>() + paths.sum::<usize>()
        })
        .sum()
    };
    let mut capacity = BUCKETS.0;
    while capacity > BUCKETS.1 && bytes(capacity) > BUDGET {
        capacity = capacity * 7 / 8;
    }
    capacity
}

/// The data to draw for `runs`.
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
        extent: share.extent(runs),
        runs: runs.iter().map(|run| share.run(run, runs[0].recording)).collect(),
    }
}

/// The least and the greatest north and east of points.
struct Extent([[f64; 2]; 2]);

impl Default for Extent {
    fn default() -> Self {
        Self([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]])
    }
}

impl Extent {
    fn add(&mut self, point: &[f64; 2]) {
        let [low, high] = &mut self.0;
        for (k, value) in point.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            low[k] = low[k].min(*value);
            high[k] = high[k].max(*value);
        }
    }

    fn is_empty(&self) -> bool {
        let [low, high] = self.0;
        low[0] > high[0]
    }

    /// Larger by its size on each side, and by a metre at least.
    fn doubled(&self) -> Self {
        let [low, high] = self.0;
        let size = [0, 1].map(|k| (high[k] - low[k]).max(1.0));
        Self([[0, 1].map(|k| low[k] - size[k]), [0, 1].map(|k| high[k] + size[k])])
    }

    fn has(&self, point: &[f64; 2]) -> bool {
        let [low, high] = self.0;
        (0..2).all(|k| (low[k]..=high[k]).contains(&point[k]))
    }
}

/// The settings that all runs of a page share.
struct Share {
    /// Buckets per series.
    capacity: usize,
    /// Whether innovations have their 3σ.
    bands: bool,
    /// Runs whose first positions differ still share one map.
    origin: Option<LocalFrame>,
}

impl Share {
    fn run(&self, run: &Run<'_>, first: &Recording) -> RunData {
        let r = run.recording;
        let shift = self.shift(r);
        let smoothed = r.smoothed.as_deref().filter(|_| self.bands);
        let smoothed = smoothed
            .zip(run.summary.smoothed())
            .map(|(r, s)| self.smoothed(r, s.score.as_ref()));
        let sensors = r.sensors.iter().filter(|s| !s.updates.is_empty());
        RunData {
            name: run.name.to_owned(),
            quantities: self.quantities(r, run.summary.score()),
            path: self.path(r, &r.path),
            true_path: self.path(r, &r.true_path),
            withheld: run.summary.judge().source.clone().filter(|_| !run.summary.judge().used_rows),
            smoothed,
            sensors: sensors.map(|s| self.sensor(s, run.summary, &shift)).collect(),
            inputs: r.inputs.iter().filter(|i| !i.trace.is_empty()).map(|i| self.input(i)).collect(),
            parameters: r.parameters.tracks().map(|p| self.parameter(p)).collect(),
            nees: self.nees(&r.nees),
            differences: self.differences(r, first, &shift),
            details: r.details.iter().map(|d| (d.title.clone(), d.centre.si(), d.size.si())).collect(),
            wanted: wanted(run.summary),
            asked: asked(run.summary, &shift),
            health: health(run.summary),
            outages: run
                .summary
                .score()
                .into_iter()
                .flat_map(|s| &s.drift)
                .map(|d| (d.from, d.to))
                .collect(),
            faults: faults(run.summary),
        }
    }

    /// The map spans the truth, the path asked for, the used fixes of the first run and the estimates in good health.
    /// Other estimates and rejected fixes count if they are no farther away than the size of this area. Estimates made
    /// while the run was lost do not count. If there are no sound points at all, all estimates count.
    fn extent(&self, runs: &[Run<'_>]) -> [[f64; 2]; 2] {
        let (mut sound, mut all) = (Extent::default(), Extent::default());
        let mut doubtful: Vec<[f64; 2]> = Vec::new();
        for (i, run) in runs.iter().enumerate() {
            let (r, spells) = (run.recording, health(run.summary));
            let shift = self.shift(r);
            let moved = |point: &[f64; 2]| [point[0] + shift.x, point[1] + shift.y];
            let state = |t: f64| {
                spells
                    .iter()
                    .find(|(from, to, _)| (*from..=*to).contains(&t))
                    .map(|(.., state)| *state)
            };
            let smoothed = r.smoothed.iter().filter(|_| self.bands).flat_map(|s| s.path.points());
            for (t, point) in r.path.points().iter().chain(smoothed) {
                let (point, state) = (moved(point), state(*t));
                all.add(&point);
                if state.is_none_or(|state| state == State::Good.word()) {
                    sound.add(&point);
                } else if state != Some(State::Lost.word()) {
                    doubtful.push(point);
                }
            }
            r.true_path.points().iter().for_each(|(_, point)| sound.add(&moved(point)));
            asked(run.summary, &shift).iter().flatten().for_each(|point| sound.add(point));
            for sensor in r.sensors.iter().filter(|_| i == 0) {
                let [used, rejected] = &sensor.fixes;
                used.iter().for_each(|(_, [n, e, _])| sound.add(&moved(&[*n, *e])));
                doubtful.extend(rejected.iter().map(|(_, [n, e, _])| moved(&[*n, *e])));
            }
        }
        if sound.is_empty() {
            return if all.is_empty() { [[0.0; 2]; 2] } else { all.0 };
        }
        let near = sound.doubled();
        doubtful.iter().filter(|point| near.has(point)).for_each(|point| sound.add(point));
        sound.0
    }

    /// From the origin of the page to that of a recording.
    fn shift(&self, r: &Recording) -> Vector3<f64> {
        match (self.origin, r.origin()) {
            (Some(common), Some(own)) => common.to_ned(&own.origin()),
            _ => Vector3::zeros(),
        }
    }

    /// The smoothed estimates of the same run; the truth is that of the run.
    fn smoothed(&self, r: &Recording, score: Option<&Score>) -> SmoothedData {
        SmoothedData {
            quantities: self.quantities(r, score).map(|q| QuantityData {
                truth: TableData::default(),
                ..q
            }),
            path: self.path(r, &r.path),
        }
    }

    /// A path of a recording.
    fn path(&self, r: &Recording, path: &Path) -> TableData {
        TableData::of_points(&path.shaping(self.capacity), self.shift(r).as_slice())
    }

    /// Position, velocity, attitude.
    fn quantities(&self, r: &Recording, score: Option<&Score>) -> [QuantityData; 3] {
        const NED: [&str; 3] = ["North", "East", "Down"];
        const RPY: [&str; 3] = ["Roll", "Pitch", "Yaw"];
        let (shift, none) = (self.shift(r), Vector3::zeros());
        let mut attitude = r.attitude.clone();
        if let Some(mounting) = score.and_then(|s| s.mounting_deg).filter(|_| !r.mounted.is_empty()) {
            let [roll, pitch, yaw] = mounting.map(f64::to_radians);
            (attitude.truth, attitude.error) = mounted_attitude(&r.mounted, &so3::from_rpy(roll, pitch, yaw));
        }
        [
            self.quantity(&r.position, &shift, ("Position", "m"), NED, [false; 3]),
            self.quantity(&r.velocity, &none, ("Velocity", "m/s"), NED, [false; 3]),
            self.quantity(&attitude, &none, ("Attitude", "deg"), RPY, [true, false, true]),
        ]
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
        let statistics = summary.sensors().iter().find(|t| t.name == s.name);
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
            updates: updates(s, self.capacity, &units, self.bands),
            used: TableData::of_samples(&s.fixes[0], self.capacity, shift.as_slice()),
            rejected: TableData::of_samples(&s.fixes[1], self.capacity, shift.as_slice()),
            apart: TableData::of_trace(&s.apart, self.capacity, &[], false),
            intervals: if irregular {
                TableData::of_trace(&s.intervals.series, self.capacity, &[], false)
            } else {
                TableData::default()
            },
            bars: if irregular { s.intervals.bars() } else { Vec::new() },
            nis: BandData::of(&s.nis),
            normalised: s.normalised.iter().map(NormalisedData::of).collect(),
            rejections: (s.rejections.judged > 0 && !s.own_statistic).then_some(RejectionsData {
                judged: s.rejections.judged,
                rejected: s.rejections.rejected,
                expected: s.rejections.expected,
            }),
            rows: rows.iter().map(|(name, unit)| unit.beside(name)).collect(),
        }
    }

    fn parameter(&self, p: &ParameterTrack) -> ParameterData {
        ParameterData {
            name: p.name.clone(),
            unit: p.unit.symbol().to_owned(),
            estimate: TableData::of_trace(&p.estimate, self.capacity, &[], true),
            truth: TableData::of_trace(&p.truth, self.capacity, &[], true),
        }
    }

    fn nees(&self, judged: &[Judged; 3]) -> Vec<NeesData> {
        let named = ["Position", "Velocity", "Attitude"].into_iter().zip(judged);
        let of = |(name, nees): (&'static str, &Judged)| {
            let table = TableData::of_trace(&nees.series, self.capacity, &[], false);
            BandData::of(&nees.share).map(|band| NeesData { name, band, table })
        };
        named.filter_map(of).collect()
    }

    /// Whole estimates minus those of the first run at the same times; empty for the first run itself.
    fn differences(&self, run: &Recording, first: &Recording, shift: &Vector3<f64>) -> TableData {
        let mut all = Samples::<9>::new(self.capacity);
        if core::ptr::eq(run, first) {
            return TableData::default();
        }
        let mut of_first = first.states.iter().peekable();
        for (t, own) in run.states.iter() {
            while of_first.next_if(|(other, _)| *other < t).is_some() {}
            if let Some((_, other)) = of_first.next_if(|(other, _)| *other == t) {
                all.push(t, std::array::from_fn(|k| difference(k, own[k], other[k], shift)));
            }
        }
        TableData::of_samples(&all, self.capacity, &[0.0; 9])
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

/// Number `k` of an estimate less that of another: positions by `shift`, the last three as angles within ±180°.
fn difference(k: usize, own: f64, other: f64, shift: &Vector3<f64>) -> f64 {
    let d = own - other;
    match k {
        0..3 => d + shift[k],
        6.. => d - 360.0 * math::round(d / 360.0),
        _ => d,
    }
}

/// The heading commanded by a controller \[deg\]; NaN without a command.
fn wanted(summary: &Summary) -> TableData {
    let headings = summary.control().into_iter().flat_map(|record| &record.headings);
    let (time, degrees) = headings.map(|(t, h)| (*t, h.map_or(f32::NAN, |h| h.to_degrees() as f32))).unzip();
    TableData::of(&Columns {
        time,
        values: vec![degrees],
    })
}

/// The path that the mission asked for, moved by `shift`.
fn asked(summary: &Summary, shift: &Vector3<f64>) -> Vec<[[f64; 2]; 2]> {
    let parts = summary.control().into_iter().flat_map(|record| &record.path);
    parts
        .map(|ends| ends.map(|[north, east]| [north + shift.x, east + shift.y]))
        .collect()
}

/// When which fault was at work.
fn faults(summary: &Summary) -> Vec<(f64, f64, String)> {
    let name = |f: &FaultWindow| format!("{} of {}", f.fault, f.stream);
    summary.faults().iter().map(|f| (f.from, f.to, name(f))).collect()
}

/// How the design's own filter was, from the first estimate on.
fn health(summary: &Summary) -> Vec<(f64, f64, &'static str)> {
    let spells = summary.health().first().map(FilterHealth::spells).unwrap_or_default();
    spells.into_iter().map(|s| (s.from, s.to, s.state.word())).collect()
}

impl NormalisedData {
    fn of(row: &Normalised) -> Self {
        Self {
            count: row.count,
            density: row.density(),
            autocorrelation: row.autocorrelation(),
        }
    }
}

impl BandData {
    /// `None` without counted measurements.
    fn of(share: &Inside) -> Option<Self> {
        let (low, high) = band(share.dof).into_inner();
        (share.count > 0).then_some(Self {
            dof: share.dof,
            low,
            high,
            count: share.count,
            inside: share.inside,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::table::base64;
    use crate::report::{Frame, Recording};
    use fusion::health::Transition;
    use fusion::observe::{Innovations, SensorStatistics};
    use fusion_core::filter::{Update, Verdict};
    use fusion_core::gate::Mode;
    use fusion_core::time::Time;

    #[test]
    fn a_run_that_is_lost_does_not_scale_the_map() {
        let mut recording = Recording::new(Frame::default());
        for (t, north) in [(0.0, 0.0), (5.0, 10.0), (12.0, 18.0), (15.0, 500.0), (20.0, 5.0e6)] {
            recording.path.push(t, [north, -north]);
        }
        let extent = |changes: &[(f64, State)]| {
            let change = |(time, state): &(f64, State)| Transition {
                time: *time,
                state: *state,
                ..Transition::default()
            };
            let health = FilterHealth {
                transitions: changes.iter().map(change).collect(),
                until: 20.0,
                ..FilterHealth::default()
            };
            let summary = Summary::default().with(vec![health]);
            let run = Run {
                name: "a",
                recording: &recording,
                summary: &summary,
            };
            data(&[run]).extent
        };
        // 500 m are no estimate that a path of 10 m is drawn for, 18 m are.
        let (whole, near) = ([[0.0, -5.0e6], [5.0e6, 0.0]], [[0.0, -18.0], [18.0, 0.0]]);
        assert_eq!(extent(&[(0.0, State::Good)]), whole);
        assert_eq!(extent(&[(0.0, State::Good), (10.0, State::Degraded)]), near);
        assert_eq!(extent(&[(0.0, State::Good), (11.0, State::Lost)]), [[0.0, -10.0], [10.0, 0.0]]);
        // Without sound estimates, all estimates count.
        assert_eq!(extent(&[(0.0, State::Lost)]), whole);
    }

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
            innovation_factor: &[],
            nis: 5.0,
            statistic: 5.0,
            threshold: f64::INFINITY,
            mode: Mode::Track,
            power: &[],
            weight: 1.0,
            rivals: fusion_core::filter::Rivals::NONE,
            jacobian: None,
        };
        recording.measurement("tilt", Time::default(), None, &update);
        let innovations = Innovations {
            axis: ["x", "y"].map(str::to_owned).to_vec(),
            unit: vec!["rad".to_owned(); 2],
            ..Innovations::default()
        };
        let statistics = SensorStatistics {
            name: "tilt".to_owned(),
            innovations,
            ..SensorStatistics::default()
        };
        let summary = Summary::default().with(vec![statistics]);
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
}
