//! Slow errors against one dense covariance of the errors of estimate and instrument.
//!
//! Two hundred seeds know a σ to 5 %, and a constant error of the same σ brings nearly the same. Here the true model is
//! written out: e ← Φ e + G t, e ← J [(I − K H) e + K t], t ← a t + w, with plain products.

use super::super::{Settings, budget};
use super::seeds::design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use fusion_core::filter::Step;
use fusion_core::linear::BlockMatrix;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::time::Time;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Where the three errors act.
#[derive(Clone, Copy)]
enum On {
    /// On the rows of this sensor.
    Rows(usize),
    /// On the numbers of the input whose biases begin at this axis.
    Biases(usize),
}

/// The covariance of n errors of the estimate and three of an instrument.
struct Whole {
    n: usize,
    p: DMatrix<f64>,
    on: On,
    sigma: f64,
    tau: f64,
    aged: Option<Time>,
    /// The variances of the first n errors at each estimate.
    at: BTreeMap<Time, Vec<f64>>,
}

impl Whole {
    fn new(n: usize, on: On, sigma: f64, tau: f64) -> Self {
        let mut p = DMatrix::zeros(n + 3, n + 3);
        (n..n + 3).for_each(|i| p[(i, i)] = sigma * sigma);
        let (aged, at) = (None, BTreeMap::new());
        Self {
            n,
            p,
            on,
            sigma,
            tau,
            aged,
            at,
        }
    }

    fn multiply(&mut self, m: &DMatrix<f64>) {
        self.p = m * &self.p * m.transpose();
    }

    /// [M 0; 0 I].
    fn of(&self, m: &BlockMatrix) -> DMatrix<f64> {
        let n = self.n;
        DMatrix::from_fn(
            n + 3,
            n + 3,
            |i, j| if i.max(j) < n { m.get(i, j) } else { f64::from(u8::from(i == j)) },
        )
    }

    fn age(&mut self, to: Time) {
        let dt = self.aged.replace(to).map_or(0.0, |from| to.seconds_since(from));
        let a = math::exp(-dt / self.tau);
        let mut m = DMatrix::identity(self.n + 3, self.n + 3);
        (self.n..self.n + 3).for_each(|i| m[(i, i)] = a);
        self.multiply(&m);
        (self.n..self.n + 3).for_each(|i| self.p[(i, i)] += self.sigma * self.sigma * (1.0 - a * a));
    }

    fn step(&mut self, step: &Step) {
        let n = self.n;
        match step {
            Step::Predicted {
                prior,
                transition,
                posterior,
                ..
            } => {
                let (dt, interval) = (posterior.time.seconds_since(prior.time), posterior.input.get().interval);
                // A sample is one step in this world; stamps are whole nanoseconds.
                assert!((dt - interval).abs() < 2e-9, "{dt} {interval}");
                let mut m = self.of(&transition.phi);
                if let On::Biases(bias) = self.on {
                    self.age(posterior.time);
                    for (i, k) in (0..n).flat_map(|i| (0..3).map(move |k| (i, k))) {
                        m[(i, n + k)] = if i == bias + k { 0.0 } else { -transition.phi.get(i, bias + k) };
                    }
                }
                self.multiply(&m);
            }
            Step::Corrected {
                offered,
                jacobian,
                gain,
                reset,
                posterior,
                ..
            } => {
                let is_own = matches!(self.on, On::Rows(sensor) if sensor == offered.sensor);
                if is_own {
                    self.age(posterior.time);
                }
                let rows = jacobian.rows();
                let k = DMatrix::from_fn(n, rows, |i, row| gain[row * n + i]);
                let h = DMatrix::from_fn(rows, n, |row, j| jacobian.get(row, j));
                let mut m = DMatrix::identity(n + 3, n + 3);
                m.view_mut((0, 0), (n, n)).copy_from(&(DMatrix::identity(n, n) - &k * &h));
                match self.on {
                    On::Rows(_) if is_own => m.view_mut((0, n), (n, 3)).copy_from(&k),
                    // The sample in force is in h, which reads the number minus its bias: ∂h/∂u = −∂h/∂bias.
                    On::Biases(bias) => m.view_mut((0, n), (n, 3)).copy_from(&(&k * h.columns(bias, 3))),
                    On::Rows(_) => {}
                }
                self.multiply(&m);
                if let Some(reset) = reset {
                    self.multiply(&self.of(reset));
                }
            }
            Step::Inflated { .. } => {}
        }
    }
}

impl RunObserver for Whole {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Filter {
                event: Event::Step(step), ..
            } => self.step(step),
            RunEvent::Estimate { belief, .. } => {
                let variances = (0..self.n).map(|i| self.p[(i, i)]).collect();
                self.at.insert(belief.time, variances);
            }
            _ => {}
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

#[test]
fn slow_errors_agree_with_a_covariance_that_has_them_as_states() {
    let design = design(
        "configs/ins-gps.toml",
        &[
            "simulation.imu.gyro.markov={ sigma = '20 deg/h', correlation_time = '100 s' }",
            "simulation.sensor.position.markov={ sigma = '1.5 m', correlation_time = '40 s' }",
        ],
    );
    // With fixes, at the end of an outage, and after it.
    let settings = Settings {
        at: vec![30.0, 79.0, 95.0],
        ..Settings::default()
    };
    let found = budget(&design, &settings).unwrap_or_else(|d| panic!("{d}"));
    let options = Options::default();
    let run = Run::open(&design, &options).unwrap();
    let layout = run.assembly().layout.clone();
    let gyro = layout.block("gyro_bias").unwrap().tangent;
    let mut rows = Whole::new(layout.dim(), On::Rows(0), 1.5, 40.0);
    let mut input = Whole::new(layout.dim(), On::Biases(gyro), 20.0_f64.to_radians() / 3600.0, 100.0);
    run.go(&mut [&mut rows, &mut input], &mut |_| {}).unwrap();
    // Rounding of 14,000 steps; the budget has ∂h/∂u by central differences, with 1e-6 of error.
    for (name, whole, tolerance) in [("position slow error", &rows, 1e-10), ("gyro slow error", &input, 1e-5)] {
        let source = found.sources.iter().position(|source| source == name).unwrap();
        for block in ["position", "velocity"].map(|name| layout.block(name).unwrap()) {
            for (k, axis) in block.tangent_range().enumerate() {
                let state = found.states.iter().filter(|state| state.state == block.name).nth(k).unwrap();
                for split in state.at.iter().chain([&state.end]) {
                    let wanted = whole.at[&Time::from_seconds(split.time)][axis];
                    let relative = split.variances[source] / wanted - 1.0;
                    assert!(
                        relative.abs() < tolerance,
                        "{name}, {} at {} s: {relative:e}",
                        state.name(),
                        split.time
                    );
                }
            }
        }
    }
}
