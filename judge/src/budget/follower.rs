//! Follows the steps of one run, and carries the errors of the world through them.

use super::axes::Axis;
use super::input::ByInput;
use super::result::{Course, SensorRows, Split, StateBudget};
use super::segment::Segment;
use super::spread::Spread;
use super::world::{Acts, Ages, World};
use fusion::assembly::Assembly;
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver, Thinning};
use fusion_core::belief::Belief;
use fusion_core::filter::{Step, Verdict};
use fusion_core::linear::Transition;
use fusion_core::math;
use fusion_core::model::{Input, Measurement};
use fusion_core::runner::{Event, Halt};
use fusion_core::state::{Block, Layout};
use fusion_core::time::Time;
use fusion_models::sim::write_true_motion;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The shares are taken this often at most \[ns\].
const PERIOD: i64 = 100_000_000;

pub(super) struct Follower<'a> {
    design: &'a Design,
    world: World,
    layout: Arc<Layout>,
    gravity: fusion_models::earth::Gravity,
    models: Vec<Arc<dyn Measurement>>,
    spread: Spread,
    /// The steps that `spread` does not have yet.
    segment: Segment,
    by_input: ByInput,
    /// The numbers of the input that have errors, each with its errors.
    channels: BTreeMap<usize, Vec<usize>>,
    /// The rows of sensors in the design that have errors.
    rows: BTreeMap<(usize, usize), Vec<usize>>,
    has_started: bool,
    /// The rest of the present sample of the input \[s\].
    rest: f64,
    /// When the errors of each sensor of the design were last moved.
    measured: BTreeMap<usize, Time>,
    /// The sensor of the latest measurement.
    sensor: usize,
    counts: Vec<SensorRows>,
    axes: Vec<Axis>,
    thinning: Thinning,
    at: Vec<f64>,
    states: Vec<Sums>,
    course: Course,
}

/// The variances of an axis over the run.
#[derive(Clone, Debug, Default)]
struct Sums {
    end: Split,
    sum: Split,
    count: f64,
    at: Vec<Split>,
}

impl<'a> Follower<'a> {
    /// For the run of `assembly`; `at` are the times at which the shares are also wanted \[s\], in order.
    pub(super) fn new(design: &'a Design, world: World, assembly: &Assembly, at: &[f64]) -> Self {
        let layout = assembly.layout.clone();
        let errors: Vec<_> = world
            .errors
            .iter()
            .map(|e| (world.sources[e.source].block, e.ages.first()))
            .collect();
        let (mut channels, mut rows) = (BTreeMap::<_, Vec<_>>::new(), BTreeMap::<_, Vec<_>>::new());
        for (number, error) in world.errors.iter().enumerate() {
            match error.acts {
                Acts::Input(channel, _) => channels.entry(channel).or_default().push(number),
                Acts::Row(sensor, row) => rows.entry((sensor, row)).or_default().push(number),
                _ => {}
            }
        }
        let axes = Axis::all(&layout, &world);
        let spread = Spread::new(layout.dim(), world.blocks, &errors);
        Self {
            design,
            gravity: assembly.gravity,
            models: assembly.sensors.iter().map(|info| info.model.clone()).collect(),
            segment: Segment::new(&spread),
            spread,
            by_input: ByInput::new(&layout, &assembly.process),
            channels,
            rows,
            has_started: false,
            rest: 0.0,
            measured: BTreeMap::new(),
            sensor: 0,
            counts: assembly.sensors.iter().map(|info| SensorRows::new(&info.name)).collect(),
            thinning: Thinning::new(PERIOD),
            at: at.to_vec(),
            states: vec![Sums::default(); axes.len()],
            course: Course::default(),
            axes,
            world,
            layout,
        }
    }

    /// The names of the sources, the states, the shares over time, the counts of rows, and what is left out.
    pub(super) fn finish(self) -> (Vec<String>, Vec<StateBudget>, Course, Vec<SensorRows>, Vec<String>) {
        let names = self.world.sources.into_iter().map(|source| source.name).collect();
        let states = self.axes.into_iter().zip(self.states).map(|(axis, sums)| StateBudget {
            state: axis.state,
            axis: axis.axis,
            unit: axis.unit,
            end: sums.end,
            rms: sums.sum.over(sums.count.max(1.0)),
            at: sums.at,
        });
        (names, states.collect(), self.course, self.counts, self.world.outside)
    }

    /// The filter starts, or starts again.
    fn started(&mut self, belief: &Belief) -> Result<(), Halt> {
        self.segment.end(&mut self.spread);
        let kinematic = |b: &&Block| b.role == fusion_core::state::StateRole::Kinematic;
        for block in self.layout.blocks().iter().filter(kinematic) {
            self.spread.forget(block.tangent_range());
        }
        let is_first = !core::mem::replace(&mut self.has_started, true);
        for (number, error) in self.world.errors.iter().enumerate() {
            let mut l = vec![0.0; self.layout.dim()];
            match (error.acts, error.ages) {
                (Acts::Axis(axis), _) if is_first => l[axis] = 1.0,
                (Acts::Start(place, column), _) => {
                    let block = &self.layout.blocks()[place];
                    let root = root(&belief.covariance.block(block), block.kind.dim());
                    block.tangent_range().enumerate().for_each(|(i, axis)| l[axis] = root[(i, column)]);
                }
                (Acts::Offset, _) => l = self.offset(belief, is_first)?,
                (Acts::Input(..), Ages::Walk(density)) if is_first => {
                    self.spread.age(number, 1.0, density * density * belief.time.seconds().max(0.0));
                    continue;
                }
                _ => continue,
            }
            self.spread.act(number, &l);
        }
        self.add_found(belief, |_| true);
        Ok(())
    }

    /// The difference between the declared start and the truth.
    fn offset(&self, belief: &Belief, is_first: bool) -> Result<Vec<f64>, Halt> {
        let (layout, mut truth) = (&self.layout, belief.x.clone());
        if let (Some(simulation), Some(origin)) = (&self.design.simulation, self.design.run.origin) {
            let place = (origin.into(), self.gravity);
            write_true_motion(&simulation.block.world, layout, place, belief.time, &mut truth).map_err(|e| e.to_string())?;
        }
        if is_first {
            for block in &self.world.of_instruments {
                truth[block.storage_range()].fill(0.0);
            }
            for (block, value) in &self.world.given {
                truth[block.storage_range()].copy_from_slice(value);
            }
        }
        let found = self
            .world
            .found
            .iter()
            .flat_map(|(_, names)| layout.blocks().iter().filter(|b| names.contains(&b.name)));
        for block in self.world.drawn.iter().chain(found) {
            truth[block.storage_range()].copy_from_slice(&belief.x[block.storage_range()]);
        }
        let mut off = vec![0.0; layout.dim()];
        layout.minus(&belief.x, &truth, &mut off);
        Ok(off)
    }

    /// Adds the covariance of blocks that initialisers found from data, on the axes for which `is_new`.
    fn add_found(&mut self, belief: &Belief, is_new: impl Fn(usize) -> bool) {
        let Some((own, names)) = &self.world.found else { return };
        for block in self.layout.blocks().iter().filter(|b| names.contains(&b.name)) {
            let (d, p) = (block.kind.dim(), belief.covariance.block(block));
            for (i, axis) in block.tangent_range().enumerate().filter(|(_, axis)| is_new(*axis)) {
                for (j, other) in block.tangent_range().enumerate() {
                    self.spread.add(*own, axis, other, p[i * d + j]);
                }
            }
        }
    }

    fn predicted(&mut self, prior: &Belief, transition: &Transition, posterior: &Belief) {
        let (dt, input) = (posterior.time.seconds_since(prior.time), posterior.input.get());
        let is_driven = !self.channels.is_empty() && input.interval > 0.0 && dt > 0.0;
        if is_driven {
            self.sampled(&input, dt);
        }
        let (world, segment) = (&self.world, &mut self.segment);
        let gaps = (input.interval <= 0.0).then_some(world.gaps).flatten();
        let label = |axis: usize| world.process[axis].or(gaps);
        let is_own = |axis: usize| world.moved.iter().any(|m| m.axis == axis);
        let owner = |i: usize, j: usize| label(i).filter(|own| !is_own(i) && Some(*own) == label(j));
        let owned = |(i, j, value)| Some((owner(i, j)?, i, j, value));
        for (own, i, j, value) in transition.noise_before().filter_map(owned) {
            segment.add(own, i, j, value);
        }
        segment.carry(transition.phi.changes());
        for (own, i, j, value) in transition.noise_after().filter_map(owned) {
            segment.add(own, i, j, value);
        }
        for moved in &world.moved {
            segment.add(moved.block, moved.axis, moved.axis, fresh(moved.ages, dt).1);
        }
        if is_driven {
            self.driven(prior, (&input, dt), transition);
        }
        if dt == 0.0 && self.world.found.is_some() {
            self.segment.end(&mut self.spread);
            self.add_found(posterior, |axis| transition.phi.get(axis, axis) == 0.0);
        }
        if self.segment.is_long() {
            self.segment.end(&mut self.spread);
        }
    }

    /// Moves the errors of the input by one sample, if a new one begins.
    fn sampled(&mut self, input: &Input<'_>, dt: f64) {
        // Stamps are whole nanoseconds.
        const ROUNDING: f64 = 2e-9;
        if self.rest < ROUNDING {
            self.rest = input.interval;
            for number in self.channels.values().flatten() {
                let (decay, fresh) = match self.world.errors[*number].ages {
                    Ages::Constant(_) => continue,
                    Ages::White(density) => (0.0, density * density / input.interval),
                    ages => fresh(ages, input.interval),
                };
                self.segment.age(*number, decay, fresh);
            }
        }
        self.rest -= dt;
    }

    /// The errors of the input act on the state. Where the filter estimates the bias of a number, Φ has the response to it.
    fn driven(&mut self, prior: &Belief, (input, dt): (&Input<'_>, f64), transition: &Transition) {
        let mut response = vec![0.0; self.layout.dim()];
        for (channel, errors) in &self.channels {
            match self.bias_of(*channel) {
                Some(bias) => {
                    let by = |i: usize| if i == bias { 0.0 } else { -transition.phi.get(i, bias) };
                    response.iter_mut().enumerate().for_each(|(i, response)| *response = by(i));
                }
                None => self.by_input.of_step(&prior.x, input, dt, *channel, &mut response),
            }
            let factors = errors.iter().map(|number| (*number, times(&self.world, *number, input)));
            self.segment.act(&response, factors);
        }
    }

    /// The axis of the bias of a number of the input.
    fn bias_of(&self, channel: usize) -> Option<usize> {
        let mut biases = self.world.biases.iter();
        biases.find(|(number, _)| *number == channel).map(|(_, axis)| *axis)
    }

    fn corrected(&mut self, prior: &Belief, step: &Step) {
        let Step::Corrected {
            jacobian,
            noise,
            gain,
            reset,
            ..
        } = step
        else {
            return;
        };
        self.segment.end(&mut self.spread);
        let (n, m) = (self.layout.dim(), jacobian.rows());
        let h: Vec<f64> = (0..m).flat_map(|row| jacobian.row(row)[..n].iter().copied()).collect();
        self.spread.correct(&h, gain);
        self.rows_act(prior.time, m, gain);
        self.declared_acts(noise, m, gain);
        let input = prior.input.get();
        if !self.channels.is_empty() && input.interval > 0.0 && self.models[self.sensor].reads_signals() {
            self.input_acts(prior, &input, (&h, gain));
        }
        self.passed_on_acts(&input, gain);
        if let Some(reset) = reset {
            let changes: Vec<_> = reset.changes().collect();
            self.spread.carry(&changes);
        }
    }

    /// The errors of the rows of the latest sensor act: e ← e + K v.
    fn rows_act(&mut self, time: Time, m: usize, gain: &[f64]) {
        let (n, place) = (self.layout.dim(), &self.world.sensors[self.sensor]);
        let since = self
            .measured
            .insert(place.design, time)
            .map_or(0.0, |last| time.seconds_since(last));
        let own = self.rows.range((place.design, 0)..(place.design + 1, 0));
        for ((_, row), errors) in own {
            for number in errors {
                let ages = self.world.errors[*number].ages;
                let is_here = (place.first..place.first + m).contains(row);
                match ages {
                    Ages::White(sigma) if is_here => self.spread.age(*number, 0.0, sigma * sigma),
                    Ages::Markov(..) => {
                        let (decay, fresh) = fresh(ages, since);
                        self.spread.age(*number, decay, fresh);
                    }
                    _ => {}
                }
                if is_here {
                    let k = &gain[(row - place.first) * n..(row - place.first + 1) * n];
                    self.spread.act(*number, k);
                }
            }
        }
    }

    /// The declared noise of a sensor that reads another instrument: v = L t, R = L Lᵀ.
    fn declared_acts(&mut self, noise: &[f64], m: usize, gain: &[f64]) {
        let own = |acts: &Acts| matches!(acts, Acts::Declared(sensor, _) if *sensor == self.sensor);
        let errors: Vec<usize> = (0..self.world.errors.len()).filter(|k| own(&self.world.errors[*k].acts)).collect();
        if errors.is_empty() {
            return;
        }
        let (n, root) = (self.layout.dim(), root(noise, m));
        for (column, number) in errors.into_iter().enumerate() {
            let l: Vec<f64> = (0..n).map(|i| (0..m).map(|r| gain[r * n + i] * root[(r, column)]).sum()).collect();
            self.spread.age(number, 0.0, 1.0);
            self.spread.act(number, &l);
        }
    }

    /// The errors of the sample in force are in the prediction: e ← e − K ∂h/∂u δu.
    fn input_acts(&mut self, prior: &Belief, input: &Input<'_>, (h, gain): (&[f64], &[f64])) {
        let (n, model) = (self.layout.dim(), self.models[self.sensor].clone());
        let mut by = vec![0.0; h.len() / n];
        for (channel, errors) in &self.channels {
            // A model that reads the number in signals also sees its bias.
            let is_seen = |bias: usize| h.chunks_exact(n).any(|row| row[bias] != 0.0);
            if self.bias_of(*channel).is_some_and(|bias| !is_seen(bias)) {
                continue;
            }
            let is_defined = self.by_input.of_measurement(model.as_ref(), &prior.x, input, *channel, &mut by);
            if !is_defined || by.iter().all(|d| *d == 0.0) {
                continue;
            }
            for number in errors {
                let factor = times(&self.world, *number, input);
                let k = |i: usize| by.iter().zip(gain.chunks_exact(n)).map(|(by, k)| by * k[i]).sum::<f64>();
                let l: Vec<f64> = (0..n).map(|i| -factor * k(i)).collect();
                self.spread.act(*number, &l);
            }
        }
    }

    /// A stage has passed on a number of the input, or its mean over some time: its lasting errors are in the row, and its
    /// noise is the declared one.
    fn passed_on_acts(&mut self, input: &Input<'_>, gain: &[f64]) {
        let numbers = &self.world.sensors[self.sensor].passed_on;
        for (channel, k) in numbers.iter().zip(gain.chunks_exact(self.layout.dim())) {
            for number in self.channels.get(channel).into_iter().flatten() {
                if !matches!(self.world.errors[*number].ages, Ages::White(_)) {
                    let factor = times(&self.world, *number, input);
                    let l: Vec<f64> = k.iter().map(|k| factor * k).collect();
                    self.spread.act(*number, &l);
                }
            }
        }
    }

    /// The shares at an estimate.
    fn estimate(&mut self, belief: &Belief) {
        self.segment.end(&mut self.spread);
        let from = self.design.reference.as_ref().and_then(|r| r.block.from);
        let (time, counts) = (belief.time.seconds(), from.is_none_or(|from| belief.time.seconds() >= from.si()));
        let due = self.states.first().map_or(0, |s| s.at.len());
        let is_due = self.at.get(due).is_some_and(|at| time >= *at);
        for (axis, sums) in self.axes.iter().zip(&mut self.states) {
            let a = axis.along(&belief.x);
            sums.end = Split {
                time,
                variances: axis.variances(&a, &self.world, &self.spread),
                filter: axis.reported(&a, belief),
            };
            if counts {
                sums.sum.add(&sums.end);
                sums.count += 1.0;
            }
            if is_due {
                sums.at.push(sums.end.clone());
            }
        }
        self.course.push(time, self.states.iter().map(|s| &s.end));
    }
}

impl RunObserver for Follower<'_> {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Filter { filter, event } if filter.is_outermost() => match event {
                Event::Started { belief, .. } => self.started(belief)?,
                Event::Updated { sensor, update, .. } => {
                    self.sensor = *sensor;
                    let counts = &mut self.counts[*sensor];
                    match update.verdict {
                        Verdict::Accepted | Verdict::Reacquired => counts.used += 1,
                        _ => counts.rejected += 1,
                    }
                }
                Event::Step(Step::Predicted {
                    prior,
                    transition,
                    posterior,
                    ..
                }) => self.predicted(prior, transition, posterior),
                Event::Step(step @ Step::Corrected { prior, .. }) => self.corrected(prior, step),
                _ => {}
            },
            RunEvent::Estimate { filter, belief, .. } if filter.is_outermost() && self.thinning.takes(belief.time) => {
                self.estimate(belief);
            }
            _ => {}
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

/// Decay and fresh variance of an error over `dt` seconds.
fn fresh(ages: Ages, dt: f64) -> (f64, f64) {
    match ages {
        Ages::Markov(sigma, tau) => {
            let decay = math::exp(-dt / tau);
            (decay, sigma * sigma * (1.0 - decay * decay))
        }
        Ages::Walk(density) => (1.0, density * density * dt),
        Ages::Constant(_) | Ages::White(_) => (1.0, 0.0),
    }
}

/// The factor by which an error of the input acts on its number.
fn times(world: &World, number: usize, input: &Input<'_>) -> f64 {
    match world.errors[number].acts {
        Acts::Input(_, times) => times.of(input.sample),
        _ => 1.0,
    }
}

/// A root of a covariance of d axes, row by row: A with A Aᵀ = P. P may be singular.
fn root(p: &[f64], d: usize) -> DMatrix<f64> {
    let spread = DMatrix::from_row_slice(d, d, p).symmetric_eigen();
    let sigmas: DVector<f64> = spread.eigenvalues.map(|variance| math::sqrt(variance.max(0.0)));
    spread.eigenvectors * DMatrix::from_diagonal(&sigmas)
}
