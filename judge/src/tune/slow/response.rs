//! The innovations that a slow error of a sensor causes, as its filter follows it.
//!
//! ```text
//! b  the error, of variance 1:   b⁺ = φ b + w,  φ = e^(−Δt/τ);  white noise has φ = 0
//! e  what it does to the estimate:  e ← Φ e;  ρ = h b − H e;  e ← J (e + K ρ)
//! u = hᵀS⁻¹r  the innovation r along the axis h;  (e, b) has the covariance C, and E[(e, b) u] for earlier rows
//! ```
//!
//! A filter follows a slow error, so its innovations forget the error sooner than the error decays. Φ, K, H and S of the
//! run say by how much: for each τ, the expected autocorrelation of u is exact.
//!
//! Source     Mehra 1970 (IEEE TAC 15(2), 175): the autocorrelation of innovations of a filter that is not optimal

use crate::likelihood::{BLOCKS, block};
use crate::observability::{Change, apply};
use fusion::observe::{RunEvent, RunObserver};
use fusion_core::filter::Step;
use fusion_core::linear::Jacobian;
use fusion_core::math;
use fusion_core::runner::{Event, Halt};
use fusion_core::state::{Dynamics, Layout};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::VecDeque;

/// Earlier rows whose covariance with the state is kept: each of them is paired with all later ones.
const ANCHORS: usize = 16;

/// The products of innovations along one axis, by lag.
#[derive(Clone, Debug)]
pub(super) struct Products {
    /// For each block of time and each lag: the sum of the products u u′, and their number.
    pub(super) observed: Vec<Vec<(f64, f64)>>,
    /// For each unit error and each lag: the same, as expected.
    pub(super) expected: Vec<Vec<(f64, f64)>>,
    /// Sum and number of the variance of u that the filter expects, and of the declared variance along the axis.
    pub(super) declared: (f64, f64),
    pub(super) noise: (f64, f64),
}

/// A unit error on an axis, and the covariance of what it causes.
#[derive(Clone, Debug)]
struct Unit {
    axis: usize,
    tau: f64,
    /// C, (n+1)×(n+1).
    joint: DMatrix<f64>,
    /// E[(e, b) u] for each anchor, (n+1)×[`ANCHORS`].
    past: DMatrix<f64>,
    room: DMatrix<f64>,
}

/// The rows of one sensor, and how its filter answers them.
#[derive(Debug)]
pub(super) struct Response {
    sensor: usize,
    /// The state of the error.
    state: String,
    /// The correlation times that are tried \[s\]; 0 for white noise.
    taus: Vec<f64>,
    lags: Lags,
    span: (f64, f64),
    units: Vec<Unit>,
    /// Axes of the state, their numbers in the layout.
    axes: Vec<usize>,
    /// Its unit, SI.
    pub(super) unit: &'static str,
    /// The declared 1σ of each axis and the correlation time \[s\], if the state is such an error already.
    pub(super) declared: Option<(Vec<f64>, f64)>,
    pub(super) products: Vec<Products>,
    /// e after the latest row, to e now.
    carried: DMatrix<f64>,
    room: DMatrix<f64>,
    latest: Option<f64>,
    row: usize,
    /// The number of the row in each place of the anchors.
    anchors: Vec<Option<usize>>,
    /// The latest u of each axis, the newest first.
    recent: Vec<VecDeque<f64>>,
    current: usize,
}

/// Lags in classes whose width grows with the lag.
#[derive(Clone, Debug)]
struct Lags(Vec<usize>);

impl Lags {
    /// Up to a longest lag: 0, 1, 2, 3, and then by a factor of √2.
    fn up_to(longest: usize) -> Self {
        let mut first = vec![0, 1];
        while let Some(last) = first.last().copied().filter(|last| *last <= longest) {
            first.push((last + 1).max(math::round(last as f64 * std::f64::consts::SQRT_2) as usize));
        }
        Self(first)
    }

    fn classes(&self) -> usize {
        self.0.len() - 1
    }

    fn class(&self, lag: usize) -> Option<usize> {
        let class = self.0.partition_point(|first| *first <= lag) - 1;
        (class < self.classes()).then_some(class)
    }

    fn longest(&self) -> usize {
        self.0[self.classes()] - 1
    }
}

impl Response {
    /// For the sensor with this number in the design, with about `rows` rows in `span` \[s\].
    pub(super) fn new(sensor: usize, state: String, taus: Vec<f64>, rows: usize, span: (f64, f64)) -> Self {
        // With longer lags, an average has fewer than four independent products.
        let lags = Lags::up_to((rows / 4).max(1));
        Self {
            sensor,
            state,
            taus,
            lags,
            span,
            units: Vec::new(),
            axes: Vec::new(),
            unit: "",
            declared: None,
            products: Vec::new(),
            carried: DMatrix::zeros(0, 0),
            room: DMatrix::zeros(0, 0),
            latest: None,
            row: 0,
            anchors: vec![None; ANCHORS],
            recent: Vec::new(),
            current: usize::MAX,
        }
    }

    pub(super) fn taus(&self) -> &[f64] {
        &self.taus
    }

    /// The filter starts, or starts again.
    fn start(&mut self, layout: &Layout) {
        let n = layout.dim();
        let state = layout.blocks().iter().find(|block| block.name == self.state);
        self.axes = state.map_or_else(Vec::new, |block| block.tangent_range().collect());
        self.unit = state.map_or("", |block| block.unit);
        self.declared = state.and_then(|block| match &block.dynamics {
            Dynamics::GaussMarkov { sigma, tau } => Some((sigma.to_vec(), *tau)),
            _ => None,
        });
        let unit = |axis: usize, tau: f64| {
            let mut joint = DMatrix::zeros(n + 1, n + 1);
            joint[(n, n)] = 1.0;
            let past = DMatrix::zeros(n + 1, ANCHORS);
            let room = DMatrix::zeros(n + 1, n + 1);
            Unit {
                axis,
                tau,
                joint,
                past,
                room,
            }
        };
        let count = self.axes.len();
        self.units = (0..count)
            .flat_map(|axis| self.taus.iter().map(move |tau| unit(axis, *tau)))
            .collect();
        self.carried = DMatrix::identity(n, n);
        self.room = self.carried.clone();
        self.latest = None;
        self.anchors.fill(None);
        self.recent = vec![VecDeque::new(); count];
        if self.products.is_empty() {
            let classes = self.lags.classes();
            let none = Products {
                observed: vec![vec![(0.0, 0.0); classes]; BLOCKS],
                expected: vec![vec![(0.0, 0.0); classes]; self.taus.len()],
                declared: (0.0, 0.0),
                noise: (0.0, 0.0),
            };
            self.products = vec![none; count];
        }
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Predicted { transition, .. } => {
                let changes: Vec<Change> = transition.phi.changes().map(|(i, j, v)| (i.into(), j.into(), v)).collect();
                apply(&changes, &mut self.carried, &mut self.room);
            }
            Step::Inflated { .. } => {}
            Step::Corrected {
                prior,
                jacobian,
                noise,
                residual,
                innovation,
                gain,
                reset,
                ..
            } => {
                let (m, n) = (residual.len(), self.carried.nrows());
                let h = dense(jacobian, m, n);
                // The numbers are Kᵀ row by row, which is K column by column.
                let k = DMatrix::from_column_slice(n, m, gain);
                if self.current == self.sensor {
                    let s = DMatrix::from_row_slice(m, m, innovation);
                    let r = DMatrix::from_row_slice(m, m, noise);
                    self.hear(prior.time.seconds(), &h, &k, (&s, &r), residual);
                } else {
                    let seen = &h * &self.carried;
                    self.carried.gemm(-1.0, &k, &seen, 1.0);
                }
                if let Some(reset) = reset {
                    let changes: Vec<Change> = reset.changes().map(|(i, j, v)| (i.into(), j.into(), v)).collect();
                    apply(&changes, &mut self.carried, &mut self.room);
                }
            }
        }
    }

    /// A row of the sensor.
    fn hear(&mut self, time: f64, h: &DMatrix<f64>, k: &DMatrix<f64>, (s, r): (&DMatrix<f64>, &DMatrix<f64>), residual: &[f64]) {
        let n = self.carried.nrows();
        let (Some(expected), Some(noise)) = (s.clone().cholesky(), r.clone().cholesky()) else {
            return;
        };
        let elapsed = self.latest.replace(time).map_or(0.0, |latest| time - latest);
        // Each axis: the column of H, hᵀS⁻¹, and the row (−H, h) of ρ.
        let axes: Vec<(DVector<f64>, DVector<f64>, DMatrix<f64>)> = self
            .axes
            .iter()
            .map(|axis| {
                let own: DVector<f64> = h.column(*axis).into_owned();
                let mut row = -h.clone().insert_column(n, 0.0);
                row.set_column(n, &own);
                (own.clone(), expected.solve(&own), row)
            })
            .collect();
        for (axis, (own, along, _)) in axes.iter().enumerate().filter(|(_, (own, ..))| own.amax() > 0.0) {
            let u = along.iter().zip(residual).map(|(a, r)| a * r).sum::<f64>();
            let products = &mut self.products[axis];
            let recent = &mut self.recent[axis];
            recent.push_front(u);
            recent.truncate(self.lags.longest() + 1);
            let at = block(self.span, time);
            for (lag, earlier) in recent.iter().enumerate() {
                if let Some(class) = self.lags.class(lag) {
                    add(&mut products.observed[at][class], u * earlier);
                }
            }
            add(&mut products.declared, along.dot(own));
            add(&mut products.noise, 1.0 / own.dot(&noise.solve(own)));
        }
        let (carried, anchors, row, lags) = (&self.carried, &self.anchors, self.row, &self.lags);
        // A new anchor takes the place of the oldest one.
        let spacing = (lags.longest() / ANCHORS).max(1);
        let place = row.is_multiple_of(spacing).then_some(row / spacing % ANCHORS);
        let expected = self.units.par_iter_mut().map(|unit| {
            let (own, along, ahead) = &axes[unit.axis];
            if own.amax() > 0.0 {
                unit.hear(carried, elapsed, (along, ahead), k, place)
            } else {
                Vec::new()
            }
        });
        let expected: Vec<Vec<f64>> = expected.collect();
        for (number, seen) in expected.iter().enumerate().filter(|(_, seen)| !seen.is_empty()) {
            let (axis, tau) = (number / self.taus.len(), number % self.taus.len());
            let own = &mut self.products[axis].expected[tau];
            add(&mut own[0], seen[0]);
            for (anchor, value) in anchors.iter().zip(&seen[1..]) {
                if let Some(class) = anchor.and_then(|anchor| lags.class(row - anchor)) {
                    add(&mut own[class], *value);
                }
            }
        }
        if let Some(place) = place {
            self.anchors[place] = Some(row);
        }
        self.row += 1;
        self.carried.fill_with_identity();
    }
}

impl Unit {
    /// Moves it to the next row.
    fn carry(&mut self, carried: &DMatrix<f64>, elapsed: f64) {
        let n = carried.nrows();
        let decay = if self.tau > 0.0 { math::exp(-elapsed / self.tau) } else { 0.0 };
        let mut whole = carried.clone().resize(n + 1, n + 1, 0.0);
        whole[(n, n)] = decay;
        self.joint = &whole * &self.joint * whole.transpose();
        self.joint[(n, n)] += 1.0 - decay * decay;
        self.past = whole * &self.past;
    }

    /// Moves it to a row and through its correction. Returns the variance of u, and its covariance with u of each anchor.
    fn hear(
        &mut self,
        carried: &DMatrix<f64>,
        elapsed: f64,
        (along, ahead): (&DVector<f64>, &DMatrix<f64>),
        k: &DMatrix<f64>,
        place: Option<usize>,
    ) -> Vec<f64> {
        self.carry(carried, elapsed);
        let n = k.nrows();
        let seen = ahead.tr_mul(along);
        let own = &self.joint * &seen;
        let mut found = vec![seen.dot(&own)];
        found.extend(self.past.tr_mul(&seen).iter());
        if let Some(place) = place {
            self.past.set_column(place, &own);
        }
        let k = k.clone().resize_vertically(n + 1, 0.0);
        let change = ahead * &self.past;
        self.past.gemm(1.0, &k, &change, 1.0);
        self.room.copy_from(&self.joint);
        self.room.gemm(1.0, &k, &(ahead * &self.joint), 1.0);
        self.joint.copy_from(&self.room);
        self.joint.gemm(1.0, &(&self.room * ahead.transpose()), &k.transpose(), 1.0);
        found
    }
}

impl RunObserver for Response {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else {
            return Ok(());
        };
        if !filter.is_outermost() {
            return Ok(());
        }
        match event {
            Event::Started { .. } => self.start(&filter.layout),
            Event::Updated { sensor, .. } => self.current = filter.sensors[*sensor].design,
            Event::Step(step) if !self.units.is_empty() => self.step(step),
            _ => {}
        }
        Ok(())
    }

    fn wants_steps(&self) -> bool {
        true
    }
}

fn dense(jacobian: &Jacobian, m: usize, n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(m, n, |i, j| jacobian.get(i, j))
}

/// Adds a value to a sum, and counts it.
fn add(sum: &mut (f64, f64), value: f64) {
    *sum = (sum.0 + value, sum.1 + 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_of_lags_hold_each_lag_once_and_grow() {
        let lags = Lags::up_to(30);
        let classes: Vec<usize> = (0..=lags.longest()).map(|lag| lags.class(lag).unwrap()).collect();
        assert_eq!(classes[..4], [0, 1, 2, 3]);
        assert!(classes.windows(2).all(|pair| pair[1] - pair[0] <= 1), "{classes:?}");
        assert!(lags.longest() >= 30 && lags.class(lags.longest() + 1).is_none());
    }

    /// A filter of a constant with the gain K and a white and a slow error: the innovations have the autocorrelation of
    /// e − x̂, x̂⁺ = x̂ + K (e − x̂). For white e of variance 1, the variance of e − x̂ is 2/(2 − K), and the covariance at
    /// lag 1 is −K/(2 − K).
    #[test]
    fn the_answer_of_a_filter_with_a_constant_gain_is_that_of_its_closed_form() {
        let gain = 0.25;
        let (h, k) = (DMatrix::from_element(1, 1, 1.0), DMatrix::from_element(1, 1, gain));
        let mut unit = Unit {
            axis: 0,
            tau: 0.0,
            joint: DMatrix::from_diagonal(&DVector::from_vec(vec![0.0, 1.0])),
            past: DMatrix::zeros(2, ANCHORS),
            room: DMatrix::zeros(2, 2),
        };
        let ahead = DMatrix::from_row_slice(1, 2, &[-1.0, 1.0]);
        let along = DVector::from_element(1, 1.0);
        let mut seen = Vec::new();
        for row in 0..200 {
            seen = unit.hear(&h, 1.0, (&along, &ahead), &k, Some(row % ANCHORS));
        }
        // After 200 rows, 0.75^400 of the start are left.
        assert!((seen[0] - 2.0 / (2.0 - gain)).abs() < 1e-12, "{seen:?}");
        // The last row is in place 199 mod 16; the one before it is at lag 1.
        let before = seen[1 + 198 % ANCHORS];
        assert!((before + gain / (2.0 - gain)).abs() < 1e-12, "{before}");
    }
}
