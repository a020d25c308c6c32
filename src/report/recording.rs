//! What a report draws, collected while a run goes on, in memory that does not grow with it.

use super::trace::{Samples, Trace};
use crate::assembly::{Assembly, StreamChannel, StreamLayout};
use crate::design::Design;
use crate::present::Unit;
use crate::score::ReferenceEpoch;
use crate::solution::{Solution, sigmas};
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::state::Manifold;
use fusion_core::time::{Time, nanos};
use fusion_models::block::Shape;
use fusion_models::earth::LocalFrame;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::VecDeque;

/// Buckets of a series: at two rows each, more than a wide screen has pixels.
const BUCKETS: usize = 8192;
/// Points of a path, and fixes of a sensor.
const POINTS: usize = 8192;
/// Input channels that are drawn; further ones are left out.
const INPUTS: usize = 24;
/// Fixes that wait for their sensor's verdict, per stream.
const WAITING: usize = 256;
/// Channels with such names say how good others are.
const QUALITY: [&str; 5] = ["sigma", "variance", "covariance", "noise", "accuracy"];

/// What the curves are relative to.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Origin of local north, east, down; the first position where there is none.
    pub origin: Option<Geodetic>,
    /// The reference's point in body axes \[m\]: the estimate is shown there.
    pub lever_arm: Vector3<f64>,
    /// Whether the mean rotation between the two bodies is taken out of the attitude errors.
    pub remove_mean_mounting: bool,
}

/// Collects one run.
///
/// ```
/// use fusion::report::{Frame, Recording};
/// let mut recording = Recording::new(Frame::default());
/// recording.input("heading", "deg", fusion::core::time::Time::from_seconds(0.1), &[90.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Recording {
    pub(super) frame: Frame,
    local: Option<LocalFrame>,
    pub(super) position: Quantity,
    pub(super) velocity: Quantity,
    pub(super) attitude: Quantity,
    /// Estimated and reference attitude and the 1σ of roll, pitch, yaw, where the mounting
    /// between the two is only known in the end.
    pub(super) mounted: Samples<11>,
    pub(super) path: Samples<2>,
    pub(super) true_path: Samples<2>,
    pub(super) sensors: Vec<SensorTrack>,
    pub(super) inputs: Vec<InputTrack>,
    ahead: VecDeque<(ReferenceEpoch, Option<Vector3<f64>>)>,
    previous: Option<(Solution, Option<Vector3<f64>>)>,
    true_angles: Unwrapped<3>,
    angles: Unwrapped<3>,
    ports: Vec<Port>,
}

/// Estimate, truth and error of a vector with three axes.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// Value and 3σ per axis.
    pub estimate: Trace,
    pub truth: Trace,
    /// Error and 3σ per axis.
    pub error: Trace,
    /// What to add to the estimate to have its turns counted like the truth's.
    pub turns: Option<Vector3<f64>>,
}

impl Quantity {
    fn new() -> Self {
        Self {
            estimate: Trace::new(6, BUCKETS),
            truth: Trace::new(3, BUCKETS),
            error: Trace::new(6, BUCKETS),
            turns: None,
        }
    }
}

/// What became of a sensor's measurements.
#[derive(Clone, Debug)]
pub(super) struct SensorTrack {
    pub name: String,
    /// The gate's statistic, where it is one other than the NIS.
    pub own_statistic: bool,
    pub gated: bool,
    /// Residual rows that are kept.
    pub rows: usize,
    /// NIS of the used, NIS of the rejected, statistic, threshold, mode (1 denied); then, of
    /// every row in SI, the innovation of the accepted, that of the rejected and readopted, and
    /// its 3σ.
    pub updates: Trace,
    /// North, east, down of the fixes: used, rejected.
    pub fixes: [Samples<3>; 2],
}

/// A group of input channels.
#[derive(Clone, Debug)]
pub(super) struct InputTrack {
    pub name: String,
    pub unit: String,
    pub trace: Trace,
    /// Factor from what the row holds.
    scale: f64,
    angle: Option<Unwrapped<1>>,
}

impl SensorTrack {
    /// Channels of the updates before those of the rows.
    pub(super) const JUDGED: usize = 5;
    /// A sensor with more residual rows is no vector in space: its rows are not kept.
    const ROWS: usize = 3;

    fn new(name: &str, residual: usize) -> Self {
        let rows = if residual <= Self::ROWS { residual } else { 0 };
        Self {
            name: name.to_owned(),
            own_statistic: false,
            gated: false,
            rows,
            updates: Trace::new(Self::JUDGED + 3 * rows, BUCKETS),
            fixes: [Samples::new(POINTS), Samples::new(POINTS)],
        }
    }
}

impl InputTrack {
    pub(super) const fn is_angle(&self) -> bool {
        self.angle.is_some()
    }
}

/// How the rows of a stream are read.
#[derive(Clone, Debug, Default)]
struct Port {
    /// Channel and its track.
    inputs: Vec<(StreamChannel, usize)>,
    /// Its geodetic channel, the whole delay of the sensor that reads it \[ns\], and that sensor.
    fix: Option<(StreamChannel, i64, usize)>,
    waiting: VecDeque<(Time, Geodetic)>,
}

/// Angles in degrees made continuous.
#[derive(Clone, Debug)]
struct Unwrapped<const N: usize> {
    last: Option<[f64; N]>,
}

impl<const N: usize> Unwrapped<N> {
    const NONE: Self = Self { last: None };

    fn next(&mut self, angles: [f64; N]) -> [f64; N] {
        let last = self.last.unwrap_or([0.0; N]);
        let near = std::array::from_fn(|i| angles[i] - 360.0 * ((angles[i] - last[i]) / 360.0).round());
        self.last = Some(near);
        near
    }
}

impl Recording {
    /// An empty recording.
    #[must_use]
    pub fn new(frame: Frame) -> Self {
        Self {
            local: frame.origin.map(LocalFrame::new),
            frame,
            position: Quantity::new(),
            velocity: Quantity::new(),
            attitude: Quantity::new(),
            mounted: Samples::new(POINTS),
            path: Samples::new(POINTS),
            true_path: Samples::new(POINTS),
            sensors: Vec::new(),
            inputs: Vec::new(),
            ahead: VecDeque::new(),
            previous: None,
            true_angles: Unwrapped::NONE,
            angles: Unwrapped::NONE,
            ports: Vec::new(),
        }
    }

    /// For a run of `design`: [`row`](Self::row) then finds sensor data and fixes by itself.
    #[must_use]
    pub fn of(design: &Design, assembly: &Assembly) -> Self {
        let reference = design.reference.as_ref().map(|r| &r.block);
        let mut recording = Self::new(Frame {
            origin: design.run.origin.map(Into::into),
            lever_arm: reference.map_or_else(Vector3::zeros, |r| r.lever_arm.si().into()),
            remove_mean_mounting: reference.is_some_and(|r| r.remove_mean_mounting),
        });
        for sensor in &assembly.sensors {
            recording.sensor(&sensor.name, sensor.rows.len());
        }
        // What drives the process comes first, then what the sensors read.
        let driving = design.process.block.model.input();
        let drives = |c: &StreamChannel| driving.iter().any(|d| d.name == c.name);
        for stream in &assembly.streams {
            recording.ports.push(Port::default());
            if stream.name == crate::world::REFERENCE || reference.is_some_and(|r| r.source == stream.name) {
                continue;
            }
            recording.connect(stream, assembly);
        }
        let mut order: Vec<usize> = (0..recording.inputs.len()).collect();
        let drivers: Vec<usize> = recording
            .ports
            .iter()
            .flat_map(|p| &p.inputs)
            .filter(|(c, _)| drives(c))
            .map(|(_, i)| *i)
            .collect();
        order.sort_by_key(|i| !drivers.contains(i));
        order.truncate(INPUTS);
        for port in &mut recording.ports {
            port.inputs.retain(|(_, i)| order.contains(i));
            port.inputs
                .iter_mut()
                .for_each(|(_, i)| *i = order.iter().position(|o| o == i).unwrap_or(0));
        }
        recording.inputs = order.iter().map(|i| recording.inputs[*i].clone()).collect();
        recording
    }

    fn connect(&mut self, stream: &StreamLayout, assembly: &Assembly) {
        let id = self.ports.len() - 1;
        for channel in &stream.channels {
            let quality = QUALITY.iter().any(|q| channel.name.contains(q));
            match channel.shape {
                Shape::Geodetic => {
                    let reads = |s: &&crate::assembly::SensorInfo| {
                        let of_stream = s.stream == stream.name || stream.alias.as_ref() == Some(&s.stream);
                        of_stream
                            && s.channel
                                .as_ref()
                                .is_some_and(|c| c.shape == Shape::Geodetic && c.name == channel.name)
                    };
                    if let Some(sensor) = assembly.sensors.iter().find(reads) {
                        let index = self.sensor(&sensor.name, sensor.rows.len());
                        self.ports[id].fix = Some((channel.clone(), nanos(sensor.delay), index));
                    }
                }
                Shape::Vector | Shape::Angle if matches!(channel.width, 1 | 3) && !quality => {
                    let unit = Unit::of_si(&channel.dimension.to_string());
                    let mut name = channel.name.replace('_', " ");
                    let driving = ["angular rate", "specific force"].contains(&name.as_str());
                    if !driving && name != stream.name {
                        name = format!("{} · {name}", stream.name);
                    }
                    let angle = channel.shape == Shape::Angle && channel.width == 1;
                    let track = self.track(&name, unit.symbol(), channel.width, angle, unit.of(1.0));
                    self.ports[id].inputs.push((channel.clone(), track));
                }
                _ => {}
            }
        }
    }

    /// An estimate, in order of time.
    pub fn estimate(&mut self, solution: &Solution) {
        let t = solution.time.seconds();
        if let Some((place, p)) = solution.position {
            let ned = self.ned(&self.at_the_reference(solution, place));
            self.path.push(t, [ned.x, ned.y]);
            self.position.estimate.push(t, &six(&ned, &sigmas(&p)));
        }
        if let Some((v, p)) = solution.velocity {
            self.velocity.estimate.push(t, &six(&v, &sigmas(&p)));
        }
        let mut continuous = None;
        if let Some((rpy, sigma)) = solution.rpy() {
            let rpy: Vector3<f64> = self.angles.next(rpy.map(f64::to_degrees).into()).into();
            self.attitude.estimate.push(t, &six(&rpy, &sigma.map(f64::to_degrees)));
            continuous = Some(rpy);
        }
        let (previous, angles) = self.previous.replace((*solution, continuous)).unwrap_or((*solution, continuous));
        while let Some((epoch, true_angles)) = self.ahead.pop_front_if(|(e, _)| e.time <= solution.time) {
            if epoch.time >= previous.time {
                self.compare(&epoch, &Solution::between(&previous, solution, epoch.time), angles.zip(true_angles));
            }
        }
    }

    /// An epoch of the reference, in order of time; it may lie ahead of the estimate by any span.
    pub fn reference(&mut self, epoch: &ReferenceEpoch) {
        let t = epoch.time.seconds();
        if let Some(place) = epoch.position {
            let ned = self.ned(&place);
            self.true_path.push(t, [ned.x, ned.y]);
            self.position.truth.push(t, ned.as_slice());
        }
        if let Some(v) = epoch.velocity {
            self.velocity.truth.push(t, v.as_slice());
        }
        let angles = epoch.attitude.map(|q| {
            let rpy = self.true_angles.next(so3::to_rpy(&q).map(f64::to_degrees).into());
            self.attitude.truth.push(t, &rpy);
            rpy.into()
        });
        self.ahead.push_back((*epoch, angles));
    }

    fn compare(&mut self, epoch: &ReferenceEpoch, at: &Solution, angles: Option<(Vector3<f64>, Vector3<f64>)>) {
        let t = epoch.time.seconds();
        if let (Some((place, p)), Some(truth)) = (at.position, epoch.position) {
            let e = self.at_the_reference(at, place).difference(&truth);
            self.position.error.push(t, &six(&e, &sigmas(&p)));
        }
        if let (Some((v, p)), Some(truth)) = (at.velocity, epoch.velocity) {
            self.velocity.error.push(t, &six(&(v - truth), &sigmas(&p)));
        }
        if let (Some((q, _)), Some(truth), Some((rpy, sigma))) = (at.attitude, epoch.attitude, at.rpy()) {
            let sigma = sigma.map(f64::to_degrees);
            if self.frame.remove_mean_mounting {
                let row: Vec<f64> = q.coords.iter().chain(truth.coords.iter()).chain(sigma.iter()).copied().collect();
                self.mounted.push(t, std::array::from_fn(|i| row[i]));
            } else {
                let e = (rpy - so3::to_rpy(&truth)).map(|e| fusion_core::state::wrap(e).to_degrees());
                self.attitude.error.push(t, &six(&e, &sigma));
            }
            if let (None, Some((estimate, truth))) = (self.attitude.turns, angles) {
                self.attitude.turns = Some((truth - estimate).map(|d| 360.0 * (d / 360.0).round()));
            }
        }
    }

    /// A measurement of `sensor`, which lies at `position` if it is a fix.
    pub fn measurement(&mut self, sensor: &str, time: Time, position: Option<Geodetic>, update: &Update<'_>) {
        let index = self.sensor(sensor, update.residual.len());
        self.judged(index, time, position, update);
    }

    /// A measurement of the assembly's sensor of that number; its fix is the one that
    /// [`row`](Self::row) has seen.
    pub fn updated(&mut self, sensor: usize, time: Time, update: &Update<'_>) {
        let port = self.ports.iter_mut().find(|p| p.fix.as_ref().is_some_and(|f| f.2 == sensor));
        let fix = port.and_then(|p| {
            let at = p.waiting.iter().position(|(t, _)| *t == time)?;
            p.waiting.drain(..=at).next_back().map(|(_, place)| place)
        });
        if sensor < self.sensors.len() {
            self.judged(sensor, time, fix, update);
        }
    }

    fn judged(&mut self, sensor: usize, time: Time, position: Option<Geodetic>, update: &Update<'_>) {
        let rejected = update.verdict == Verdict::Rejected;
        let ned = position.map(|p| self.ned(&p));
        let track = &mut self.sensors[sensor];
        let differs = (update.statistic - update.nis).abs() > 1e-9 * update.nis.abs();
        track.own_statistic |= differs;
        track.gated |= update.threshold.is_finite() || update.mode == Mode::Denied;
        let pick = |chosen: bool| if chosen && update.nis.is_finite() { update.nis } else { f64::NAN };
        let finite = |v: f64| if v.is_finite() { v } else { f64::NAN };
        let denied = f64::from(u8::from(update.mode == Mode::Denied));
        let mut row = [f64::NAN; SensorTrack::JUDGED + 3 * SensorTrack::ROWS];
        row[..SensorTrack::JUDGED].copy_from_slice(&[
            pick(!rejected),
            pick(rejected),
            finite(update.statistic),
            finite(update.threshold),
            denied,
        ]);
        let kind = match update.verdict {
            Verdict::Accepted => Some(0),
            // Readopted against the estimate, it is as far off as the rejected before it.
            Verdict::Rejected | Verdict::Readopted => Some(1),
            Verdict::Undefined(_) | Verdict::Unusable => None,
        };
        for (i, (r, sigma)) in update.residual.iter().zip(update.innovation_sigma).take(track.rows).enumerate() {
            let own = |kind: usize| SensorTrack::JUDGED + kind * track.rows + i;
            if let Some(kind) = kind {
                row[own(kind)] = *r;
            }
            row[own(2)] = 3.0 * sigma;
        }
        track.updates.push(time.seconds(), &row[..track.updates.channels()]);
        if let Some(ned) = ned {
            track.fixes[usize::from(rejected)].push(time.seconds(), ned.into());
        }
    }

    /// Sensor data in `unit`: one number, or three along the body's axes.
    pub fn input(&mut self, name: &str, unit: &str, time: Time, values: &[f64]) {
        if let Some(at) = self.inputs.iter().position(|i| i.name == name) {
            self.sample(at, time, values);
        } else if self.inputs.len() < INPUTS {
            let at = self.track(name, unit, values.len(), unit == "deg" && values.len() == 1, 1.0);
            self.sample(at, time, values);
        }
    }

    /// A raw row of a stream of the assembly, before it is fed to the runner.
    pub fn row(&mut self, stream: usize, time: Time, row: &[f64]) {
        let Some(mut port) = self.ports.get_mut(stream).map(std::mem::take) else {
            return;
        };
        for (channel, track) in &port.inputs {
            self.sample(
                *track,
                time.shifted(-channel.delay),
                &row[channel.offset..channel.offset + channel.width],
            );
        }
        if let Some((channel, delay, _)) = &port.fix {
            let values = &row[channel.offset..channel.offset + channel.width];
            if values.iter().all(|v| v.is_finite()) {
                if port.waiting.len() == WAITING {
                    port.waiting.pop_front();
                }
                port.waiting.push_back((time.shifted(-delay), Geodetic::read(values)));
            }
        }
        self.ports[stream] = port;
    }

    /// First and last time \[s\] of anything recorded.
    pub(super) fn span(&self) -> Option<(f64, f64)> {
        let quantities = [&self.position, &self.velocity, &self.attitude];
        let spans = quantities.into_iter().flat_map(|q| [q.estimate.span(), q.truth.span()]);
        let spans = spans
            .chain(self.sensors.iter().map(|s| s.updates.span()))
            .chain(self.inputs.iter().map(|i| i.trace.span()));
        spans.flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// The origin of its local coordinates.
    pub(super) fn origin(&self) -> Option<LocalFrame> {
        self.local
    }

    /// Bytes held, but for the reference ahead of the estimate.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let quantities = [&self.position, &self.velocity, &self.attitude];
        let traces = quantities.into_iter().flat_map(|q| [&q.estimate, &q.truth, &q.error]);
        let traces = traces
            .chain(self.sensors.iter().map(|s| &s.updates))
            .chain(self.inputs.iter().map(|i| &i.trace));
        let fixes = self.sensors.iter().flat_map(|s| &s.fixes).map(Samples::bytes);
        let paths = [self.path.bytes(), self.true_path.bytes(), self.mounted.bytes()];
        traces.map(Trace::bytes).chain(fixes).chain(paths).sum()
    }

    fn ned(&mut self, place: &Geodetic) -> Vector3<f64> {
        self.local.get_or_insert_with(|| LocalFrame::new(*place)).to_ned(place)
    }

    fn at_the_reference(&self, at: &Solution, place: Geodetic) -> Geodetic {
        match at.attitude {
            Some((q, _)) if self.frame.lever_arm != Vector3::zeros() => place.offset(&(q * self.frame.lever_arm)),
            _ => place,
        }
    }

    /// The track of `name`, made for `residual` rows if there is none.
    fn sensor(&mut self, name: &str, residual: usize) -> usize {
        self.sensors.iter().position(|s| s.name == name).unwrap_or_else(|| {
            self.sensors.push(SensorTrack::new(name, residual));
            self.sensors.len() - 1
        })
    }

    fn track(&mut self, name: &str, unit: &str, width: usize, angle: bool, scale: f64) -> usize {
        self.inputs.push(InputTrack {
            name: name.to_owned(),
            unit: unit.to_owned(),
            trace: Trace::new(width, BUCKETS),
            scale,
            angle: angle.then_some(Unwrapped::NONE),
        });
        self.inputs.len() - 1
    }

    fn sample(&mut self, track: usize, time: Time, values: &[f64]) {
        let track = &mut self.inputs[track];
        if values.len() != track.trace.channels() || values.iter().all(|v| !v.is_finite()) {
            return;
        }
        let mut scaled = [0.0; 3];
        for (s, v) in scaled.iter_mut().zip(values) {
            *s = v * track.scale;
        }
        if let Some(angle) = &mut track.angle {
            [scaled[0]] = angle.next([scaled[0]]);
        }
        track.trace.push(time.seconds(), &scaled[..values.len()]);
    }
}

/// The attitude quantity with the mounting, now known, taken out.
pub(super) fn mounted_attitude(samples: &Samples<11>, mounting: &UnitQuaternion<f64>) -> (Trace, Trace) {
    let (mut truth, mut error) = (Trace::new(3, POINTS + 2), Trace::new(6, POINTS + 2));
    let mut angles = Unwrapped::<3>::NONE;
    let quaternion = |c: &[f64]| UnitQuaternion::new_unchecked(Quaternion::new(c[3], c[0], c[1], c[2]));
    for (t, row) in samples.iter() {
        let (estimate, reference) = (quaternion(&row[..4]), quaternion(&row[4..8]));
        let e = so3::to_rpy(&(estimate * mounting)) - so3::to_rpy(&reference);
        let e = e.map(|e| fusion_core::state::wrap(e).to_degrees());
        error.push(t, &six(&e, &Vector3::new(row[8], row[9], row[10])));
        truth.push(
            t,
            &angles.next(so3::to_rpy(&(reference * mounting.inverse())).map(f64::to_degrees).into()),
        );
    }
    (truth, error)
}

/// The value and its 3σ.
fn six(value: &Vector3<f64>, sigma: &Vector3<f64>) -> [f64; 6] {
    std::array::from_fn(|i| if i < 3 { value[i] } else { 3.0 * sigma[i - 3] })
}
