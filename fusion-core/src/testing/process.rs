//! Laws of process models.

use super::coasting::check_coasting;
use super::numeric::{column, finite, rounding, within};
use crate::linear::Transition;
use crate::math;
use crate::model::{Input, Order, Process, SignalBuffer};
use crate::state::{Block, Dynamics, Layout};
use nalgebra::DMatrix;

/// A process gives finite numbers, moves nothing in a step of zero length, and moves only the blocks with its own
/// dynamics. Its linearisation and its signal Jacobians are correct, its noise symmetric and positive.
///
/// Φ may be a truncated series in dt, so its distance from central differences need not vanish
/// but must fall faster than dt: over a quarter of the step to less than an eighth. An error of
/// the generator F falls to a quarter only. Give an `input` whose neighbour equals its sample:
/// Φ may omit the effect of coning and sculling corrections on a changing input.
///
/// A process of [`Order::Second`] also includes the whole ½F²Δt². A process of [`Order::Exact`] agrees with the
/// central differences at the step itself, for any length. Without input a process continues as
/// [`check_coasting`] requires.
///
/// # Errors
/// A sentence naming the blocks.
pub fn check_process(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Result<(), String> {
    let dt = dt.min(process.max_step());
    check_steps(layout, process, x, input, dt)?;
    check_noise(layout, process, x, input, dt)?;
    check_transition(layout, process, x, input, dt)?;
    check_second_order(layout, process, x, input, dt)?;
    check_signals(layout, process, x, input)?;
    check_coasting(layout, process, x, dt)
}

pub(super) fn check_steps(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Result<(), String> {
    let (mut moved, mut still) = (x.to_vec(), x.to_vec());
    process.propagate(&mut moved, input, dt);
    finite("the propagated state", &moved)?;
    process.propagate(&mut still, input, 0.0);
    let (mut stepped, mut t) = (x.to_vec(), Transition::new(layout));
    process.step(&mut stepped, input, dt, &mut t);
    let apart = linearised(layout, process, x, input, dt);
    let element = |t: &Transition, k: usize| t.phi.get(k / layout.dim(), k % layout.dim()).to_bits();
    let is_alike = (0..layout.dim() * layout.dim()).all(|k| element(&t, k) == element(&apart, k));
    let noise = |t: &Transition| [t.before.entries.clone(), t.after.entries.clone()];
    if stepped != moved || !is_alike || noise(&t) != noise(&apart) {
        return Err("a step in one call is another one than its two parts".to_owned());
    }
    let mut drift = vec![0.0; layout.dim()];
    layout.minus(&still, x, &mut drift);
    for b in layout.blocks() {
        let s = b.storage_range();
        if b.dynamics != Dynamics::Process && moved[s.clone()] != x[s.clone()] {
            return Err(format!("the process moves `{}`, whose dynamics are {:?}", b.name, b.dynamics));
        }
        let limit = 4.0 * rounding(b.kind, &x[s]);
        if let Some(k) = b.tangent_range().find(|&k| !within(drift[k], limit)) {
            return Err(format!("a step of no time moves `{}` by {:e}", b.name, drift[k]));
        }
    }
    Ok(())
}

fn linearised(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Transition {
    let mut t = Transition::new(layout);
    process.linearise(x, input, dt, &mut t);
    t
}

pub(super) fn check_noise(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Result<(), String> {
    let n = layout.dim();
    let t = linearised(layout, process, x, input, dt);
    let dense = |entries: &[(u16, u16, f64)]| {
        let mut q = DMatrix::zeros(n, n);
        entries.iter().for_each(|&(i, j, v)| q[(i as usize, j as usize)] += v);
        q
    };
    let phi = DMatrix::from_fn(n, n, |i, j| t.phi.get(i, j));
    let q = &phi * dense(&t.before.entries) * phi.transpose() + dense(&t.after.entries);
    finite("the process noise", q.as_slice())?;
    let name = |i: usize| {
        layout
            .blocks()
            .iter()
            .find(|b| b.tangent_range().contains(&i))
            .map_or("?", |b| b.name.as_str())
    };
    // As correlations, so that metres and radians weigh alike.
    let scale: Vec<f64> = (0..n).map(|i| math::sqrt(q[(i, i)].max(0.0))).collect();
    let mut correlation = DMatrix::zeros(n, n);
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let size = scale[i] * scale[j];
        // 1e-12: rounding of two products of Φ.
        if !within(q[(i, j)] - q[(j, i)], 1e-12 * size) {
            return Err(format!(
                "Q is not symmetric between `{}` and `{}`: {:e}, {:e}",
                name(i),
                name(j),
                q[(i, j)],
                q[(j, i)]
            ));
        }
        if size > 0.0 {
            correlation[(i, j)] = q[(i, j)] / size;
        } else if q[(i, j)] != 0.0 {
            return Err(format!(
                "Q has {:e} between `{}` and `{}`, one of which has no variance",
                q[(i, j)],
                name(i),
                name(j)
            ));
        }
    }
    let least = correlation.symmetric_eigen().eigenvalues.min();
    // −1e-9: a noise of rank below n has zeros that rounding puts on either side.
    if least < -1e-9 {
        Err(format!("Q is not positive: least eigenvalue of its correlations {least:e}"))
    } else {
        Ok(())
    }
}

/// At one element of Φ: its error `gap`, and the error `floor` that is tolerated.
struct Gap {
    gap: f64,
    floor: f64,
    analytic: f64,
    numeric: f64,
}

fn gaps(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64, col: &Block, k: usize) -> Result<Vec<Gap>, String> {
    let n = layout.dim();
    let t = linearised(layout, process, x, input, dt);
    let mut base = x.to_vec();
    process.propagate(&mut base, input, dt);
    let numeric = column(layout, col, k, x, n, &mut |x, out| {
        let mut moved = x.to_vec();
        process.propagate(&mut moved, input, dt);
        layout.minus(&moved, &base, out);
        Ok(())
    })?;
    let j = col.tangent + k;
    let mut out = Vec::with_capacity(n);
    for row in layout.blocks() {
        let noise = 8.0 * rounding(row.kind, &base[row.storage_range()]) / numeric.step;
        let identity = |i: usize| f64::from(u8::from(i == j));
        let moved = row
            .tangent_range()
            .fold(0.0, |m: f64, i| m.max((numeric.value[i] - identity(i)).abs()));
        for i in row.tangent_range() {
            let (analytic, numeric) = (t.phi.get(i, j), numeric.value[i]);
            if !(analytic.is_finite() && numeric.is_finite()) {
                return Err(format!("Φ of `{}` by `{}` is not finite", row.name, col.name));
            }
            out.push(Gap {
                gap: (analytic - numeric).abs(),
                floor: noise + 1e-6 * moved,
                analytic,
                numeric,
            });
        }
    }
    Ok(out)
}

pub(super) fn check_transition(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Result<(), String> {
    for (col, k) in layout.blocks().iter().flat_map(|b| (0..b.kind.dim()).map(move |k| (b, k))) {
        let whole = gaps(layout, process, x, input, dt, col, k)?;
        if whole.iter().all(|g| g.gap <= g.floor) {
            continue;
        }
        if process.order() == Order::Exact {
            exact(layout, &whole, col, k)?;
        }
        let quarter = gaps(layout, process, x, input, 0.25 * dt, col, k)?;
        for row in layout.blocks() {
            // The block's largest gap: single elements may cross zero.
            let worst = |g: &[Gap]| row.tangent_range().fold(0.0, |m: f64, i| m.max(g[i].gap));
            for i in row.tangent_range() {
                let (w, q) = (&whole[i], &quarter[i]);
                if w.gap > w.floor && q.gap > q.floor && q.gap > worst(&whole) / 8.0 {
                    return Err(format!(
                        "Φ of `{}` by `{}` is wrong at ({}, {k}): analytic {:e}, numeric {:e}; over a quarter of the step the gap is {:.1e} of {:.1e}",
                        row.name,
                        col.name,
                        i - row.tangent,
                        w.analytic,
                        w.numeric,
                        q.gap,
                        w.gap
                    ));
                }
            }
        }
    }
    Ok(())
}

/// No element of the column `k` of `col` is off the central differences.
fn exact(layout: &Layout, whole: &[Gap], col: &Block, k: usize) -> Result<(), String> {
    let rows = layout.blocks().iter().flat_map(|row| row.tangent_range().map(move |i| (row, i)));
    let wrong = rows.map(|(row, i)| (row, i, &whole[i])).find(|(_, _, g)| g.gap > g.floor);
    wrong.map_or(Ok(()), |(row, i, g)| {
        Err(format!(
            "Φ of `{}` by `{}` is not the derivative of the step at ({}, {k}): analytic {:e}, numeric {:e}",
            row.name,
            col.name,
            i - row.tangent,
            g.analytic,
            g.numeric
        ))
    })
}

/// Φ − I and F Δt of the same Φ: 4 (Φ(Δt/2) − I) − (Φ(Δt) − I), free of the series' second order.
fn series(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = layout.dim();
    let gain = |dt: f64| {
        let t = linearised(layout, process, x, input, dt);
        DMatrix::from_fn(n, n, |i, j| t.phi.get(i, j) - f64::from(u8::from(i == j)))
    };
    let whole = gain(dt);
    let first = 4.0 * gain(0.5 * dt) - &whole;
    (whole, first)
}

/// Φ is I + FΔt + ½F²Δt² up to terms that fall as Δt³: over a quarter of the step to less than 1/32.
/// F is taken from Φ itself, whose first order [`check_transition`] compares with the process.
fn check_second_order(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>, dt: f64) -> Result<(), String> {
    if process.order() != Order::Second {
        return Ok(());
    }
    let gaps = |dt: f64| {
        let (whole, first) = series(layout, process, x, input, dt);
        let gap = &whole - &first - 0.5 * &first * &first;
        let size = first.abs();
        // 1e-9 of the second-order term; 32 ε: rounding of the differences that F is made of.
        let floor = 1e-9 * &size * &size
            + (size + whole.abs()).map(|v| 32.0 * f64::EPSILON * v)
            + DMatrix::identity(gap.nrows(), gap.ncols()) * (32.0 * f64::EPSILON);
        (gap, floor)
    };
    let ((whole, floor), (quarter, low)) = (gaps(dt), gaps(0.25 * dt));
    for (row, col) in layout.blocks().iter().flat_map(|r| layout.blocks().iter().map(move |c| (r, c))) {
        let worst = row
            .tangent_range()
            .flat_map(|i| col.tangent_range().map(move |j| (i, j)))
            .fold(0.0, |m: f64, at| m.max(whole[at].abs()));
        for at in row.tangent_range().flat_map(|i| col.tangent_range().map(move |j| (i, j))) {
            if !within(whole[at], floor[at]) && !within(quarter[at], low[at]) && !within(quarter[at], worst / 32.0) {
                return Err(format!(
                    "Φ of `{}` by `{}` lacks second order at ({}, {}): it is {:e} off I + FΔt + ½F²Δt², and {:e} over a quarter of the step",
                    row.name,
                    col.name,
                    at.0 - row.tangent,
                    at.1 - col.tangent,
                    whole[at],
                    quarter[at]
                ));
            }
        }
    }
    Ok(())
}

fn check_signals(layout: &Layout, process: &dyn Process, x: &[f64], input: &Input<'_>) -> Result<(), String> {
    let mut at = SignalBuffer::new(layout);
    at.evaluate(process, x, input, true);
    finite("a signal", &at.values)?;
    for b in layout.blocks() {
        for k in 0..b.kind.dim() {
            let numeric = column(layout, b, k, x, layout.signal_dim(), &mut |x, out| {
                let mut moved = SignalBuffer::new(layout);
                moved.evaluate(process, x, input, false);
                for (_, kind, storage, tangent) in layout.signals() {
                    let s = storage..storage + kind.storage();
                    kind.minus(&moved.values[s.clone()], &at.values[s], &mut out[tangent..tangent + kind.dim()]);
                }
                Ok(())
            })?;
            for (name, kind, storage, tangent) in layout.signals() {
                let rows = tangent..tangent + kind.dim();
                let noise = 8.0 * rounding(kind, &at.values[storage..storage + kind.storage()]) / numeric.step;
                let scale = rows.clone().fold(0.0, |m: f64, i| m.max(numeric.value[i].abs()));
                for i in rows {
                    let (analytic, numeric) = (at.jacobian.get(i, b.tangent + k), numeric.value[i]);
                    // 1e-6: the extrapolated difference leaves h⁴/120 of the fifth derivative.
                    if !within(analytic - numeric, noise + 1e-6 * scale) {
                        let row = i - tangent;
                        return Err(format!(
                            "∂`{name}`/∂`{}` is wrong at ({row}, {k}): analytic {analytic:e}, numeric {numeric:e}",
                            b.name
                        ));
                    }
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::SignalsOut;
    use crate::state::{Declaration, LayoutBuilder, Scalar, Signal, Slot, StateRole};
    use nalgebra::Matrix1;

    /// The fault of a pendulum.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Fault {
        None,
        Generator,
        Noise,
        Signal,
        Foreign,
        Restless,
        SecondOrder,
        /// Everything taken at the start of the step.
        Start,
    }

    /// A pendulum by Euler's step, with Φ = I + FΔt of its start, or + ½F²Δt², or the derivative of it.
    #[derive(Debug)]
    struct Pendulum {
        order: Order,
        angle: Slot<Scalar>,
        rate: Slot<Scalar>,
        foreign: Slot<Scalar>,
        sine: Signal<Scalar>,
        fault: Fault,
    }

    impl Process for Pendulum {
        fn input_dim(&self) -> usize {
            0
        }
        fn order(&self) -> Order {
            self.order
        }
        fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
            let (a, w) = (self.angle.read(x), self.rate.read(x));
            let middle = a + 0.5 * dt * w;
            self.angle.write(&(a + dt * w - 0.5 * dt * dt * a.sin()), x);
            self.rate
                .write(&(w - dt * middle.sin() + if self.fault == Fault::Restless { 1e-3 } else { 0.0 }), x);
            if self.fault == Fault::Foreign {
                self.foreign.write(&1.0, x);
            }
        }
        fn linearise(&self, x: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
            let wrong = if self.fault == Fault::Generator { 1.01 } else { 1.0 };
            let (a, w) = (self.angle.read(x), self.rate.read(x));
            let stiffness = wrong * a.cos();
            out.set(self.angle, self.rate, &Matrix1::new(dt));
            out.set(self.rate, self.angle, &Matrix1::new(-dt * stiffness));
            if self.order == Order::Exact {
                let half = 0.5 * dt * dt;
                let middle = if self.fault == Fault::Start { a } else { a + 0.5 * dt * w };
                out.set(self.angle, self.angle, &Matrix1::new(1.0 - half * stiffness));
                out.set(self.rate, self.angle, &Matrix1::new(-dt * wrong * middle.cos()));
                out.set(self.rate, self.rate, &Matrix1::new(1.0 - half * wrong * middle.cos()));
            }
            if self.order == Order::Second {
                // ½F²Δt² is −½Δt² cos a on the diagonal.
                let half = 0.5 * dt * dt * stiffness;
                out.set(self.angle, self.angle, &Matrix1::new(1.0 - half));
                let lost = if self.fault == Fault::SecondOrder { 0.9 } else { 1.0 };
                out.set(self.rate, self.rate, &Matrix1::new(1.0 - lost * half));
            }
            out.noise(self.rate, self.rate, &Matrix1::new(dt));
            out.noise(self.angle, self.angle, &Matrix1::new(dt));
            let cross = if self.fault == Fault::Noise { 1.1 } else { 0.9 };
            out.noise(self.angle, self.rate, &Matrix1::new(cross * dt));
        }
        fn signals(&self, x: &[f64], _: &Input<'_>, out: &mut SignalsOut<'_>) {
            let wrong = if self.fault == Fault::Signal { 1.001 } else { 1.0 };
            out.set(self.sine, &self.angle.read(x).sin());
            out.add(self.sine, self.angle, &Matrix1::new(wrong * self.angle.read(x).cos()));
        }
    }

    fn law(fault: Fault) -> Result<(), String> {
        law_of_order(Order::First, fault)
    }

    fn law_of_order(order: Order, fault: Fault) -> Result<(), String> {
        let mut b = LayoutBuilder::new();
        let mut declare = |name: &str, initial: f64, dynamics: Dynamics| {
            let (name, owner) = (name.to_owned(), String::new());
            b.declare::<Scalar>(Declaration {
                name,
                owner,
                unit: "",
                initial,
                sigma: vec![1.0],
                role: StateRole::Kinematic,
                dynamics,
            })
            .unwrap()
        };
        let angle = declare("angle", 0.7, Dynamics::Process);
        let rate = declare("rate", -0.4, Dynamics::Process);
        let foreign = declare("foreign", 0.0, Dynamics::Constant);
        let sine = b.signal("sine").unwrap();
        let layout = b.finish();
        check_process(
            &layout,
            &Pendulum {
                order,
                angle,
                rate,
                foreign,
                sine,
                fault,
            },
            layout.initial(),
            &Input::held(&[]),
            0.01,
        )
    }

    #[test]
    fn a_process_true_to_first_order_passes() {
        law(Fault::None).unwrap();
    }

    #[test]
    fn second_order_is_asked_of_the_process_that_promises_it() {
        law_of_order(Order::Second, Fault::None).unwrap();
        let message = law_of_order(Order::Second, Fault::SecondOrder).unwrap_err();
        assert!(message.contains("Φ of `rate` by `rate` lacks second order"), "{message}");
    }

    #[test]
    fn the_derivative_of_the_step_itself_is_asked_of_the_process_that_promises_it() {
        law_of_order(Order::Exact, Fault::None).unwrap();
        // The other orders allow an error of second order.
        law_of_order(Order::First, Fault::Start).unwrap();
        let message = law_of_order(Order::Exact, Fault::Start).unwrap_err();
        assert!(
            message.contains("Φ of `rate` by `angle` is not the derivative of the step"),
            "{message}"
        );
    }

    #[test]
    fn what_is_wrong_with_a_process_is_named() {
        for (fault, words) in [
            (Fault::Generator, ["Φ of `rate` by `angle`", "wrong"]),
            (Fault::Noise, ["Q is not positive", "eigenvalue"]),
            (Fault::Signal, ["∂`sine`/∂`angle`", "wrong"]),
            (Fault::Foreign, ["`foreign`", "Constant"]),
            (Fault::Restless, ["no time", "`rate`"]),
        ] {
            let message = law(fault).unwrap_err();
            assert!(words.iter().all(|w| message.contains(w)), "{fault:?}: {message}");
        }
    }
}
