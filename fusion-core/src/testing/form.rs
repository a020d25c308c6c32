//! Laws of the forms of the covariance and of the update rules: each gives what dense algebra gives.

use super::Lcg;
use crate::chart::{Body, Reset};
use crate::covariance::{Covariance, Form, FormKind, Kernel, Workspace, cholesky};
use crate::filter::{Estimator, Filter, Observed, Parts, UpdateRule, Verdict};
use crate::gate::Open;
use crate::linear::{BlockMatrix, Jacobian, Transition};
use crate::loss::Quadratic;
use crate::math;
use crate::model::{Input, Measurement, Process, Size, Undefined};
use crate::state::{Declaration, Dynamics, Layout, LayoutBuilder, Quantity, Scalar, Slot, StateRole, View};
use alloc::sync::Arc;
use nalgebra::{DMatrix, DVector, Matrix1};

/// A layout of `n` scalars.
pub(crate) fn scalars(n: usize) -> Result<(Layout, Vec<Slot<Scalar>>), String> {
    let mut b = LayoutBuilder::new();
    let declare = |i| {
        let (name, owner) = (format!("x{i}"), String::new());
        b.declare::<Scalar>(Declaration {
            name,
            owner,
            unit: "",
            initial: 0.0,
            sigma: vec![1.0],
            dynamics: Dynamics::Constant,
            role: StateRole::Calibration,
        })
        .map_err(|e| e.to_string())
    };
    let slots: Result<Vec<_>, _> = (0..n).map(declare).collect();
    Ok((b.finish(), slots?))
}

/// A random positive matrix.
fn positive(n: usize, random: &mut Lcg) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |_, _| random.signed());
    &a * a.transpose() + DMatrix::identity(n, n)
}

fn rows(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

fn covariance(form: &Arc<dyn Form>, p: &DMatrix<f64>) -> Covariance {
    let mut c = Covariance::zeros(p.nrows(), form.clone());
    c.set_whole(&rows(p));
    c
}

fn close(what: &str, form: &dyn Form, found: &Covariance, wanted: &DMatrix<f64>, tolerance: f64) -> Result<(), String> {
    let found = DMatrix::from_row_slice(wanted.nrows(), wanted.ncols(), &found.to_dense());
    let off = (&found - wanted).amax() / wanted.amax().max(f64::MIN_POSITIVE);
    if off.is_nan() || off > tolerance || found != found.transpose() {
        return Err(format!(
            "{} n = {}: {what} is off by {off:e} of its largest element",
            form.name(),
            wanted.nrows()
        ));
    }
    Ok(())
}

/// A form of the covariance of `n` states does what dense algebra does: blocks, scaling, prediction
/// with noise before and after Φ, congruence, projection, conditioning, also where P, Q and R are
/// singular. A prediction that would overflow leaves P unchanged, and a P that is no covariance is
/// reported.
///
/// # Errors
/// A sentence naming the operation.
pub fn check_form(form: &Arc<dyn Form>, n: usize) -> Result<(), String> {
    let mut random = Lcg::new(n as u64);
    let (layout, slots) = scalars(n)?;
    let p = positive(n, &mut random);
    // 1e-12: rounding of sums of up to 60 products, factored and put together again.
    close("what was set", form.as_ref(), &covariance(form, &p), &p, 1e-12)?;
    blocks(form, &layout, &p)?;
    let (t, phi, before, after) = transition(&layout, &slots, &mut random);
    let mut w = Workspace::new(form.as_ref(), n, 4);
    let mut c = covariance(form, &p);
    if !c.predict(&t, &mut w) {
        return Err(format!("{}: a sound prediction is refused", form.name()));
    }
    let wanted = &phi * (&p + before) * phi.transpose() + after;
    close("the prediction", form.as_ref(), &c, &wanted, 1e-12)?;
    overflow(form, &layout, &slots, &p)?;
    negative(form, &layout, &slots, &p)?;
    indefinite(form, n)?;
    singular(form, &layout, &slots, &mut random)?;
    let mut j = BlockMatrix::identity(n);
    // Twice, so that a learnt pattern is used again with other numbers.
    for _ in 0..2 {
        j.reset();
        (0..n).for_each(|k| j.set_element((k * 7) % n, (k * 5 + 1) % n, random.signed()));
        let full = DMatrix::from_fn(n, n, |a, b| j.get(a, b));
        let mut c = covariance(form, &p);
        c.congruence(&j, &mut w);
        close("the congruence", form.as_ref(), &c, &(&full * &p * full.transpose()), 1e-12)?;
    }
    for m in 1..=4.min(n) {
        conditioned(form, &layout, &slots, &p, m, &mut random)?;
    }
    Ok(())
}

/// Setting a block forgets its correlations; scaling keeps them.
fn blocks(form: &Arc<dyn Form>, layout: &Layout, p: &DMatrix<f64>) -> Result<(), String> {
    let n = p.nrows();
    let middle = n / 2;
    let mut c = covariance(form, p);
    c.set_sigmas(&layout.blocks()[middle], &[3.0]);
    let mut wanted = p.clone();
    wanted.row_mut(middle).fill(0.0);
    wanted.column_mut(middle).fill(0.0);
    wanted[(middle, middle)] = 9.0;
    close("a block that was set", form.as_ref(), &c, &wanted, 1e-12)?;
    // Several axes at once, with correlations among themselves.
    let (several, value) = (middle / 2..(middle / 2 + 3).min(n), positive(3, &mut Lcg::new(5)));
    let d = several.len();
    let value = value.view((0, 0), (d, d)).into_owned();
    let mut c = covariance(form, p);
    c.set_axes(several.clone(), &rows(&value));
    let wanted = DMatrix::from_fn(n, n, |i, j| match (several.contains(&i), several.contains(&j)) {
        (true, true) => value[(i - several.start, j - several.start)],
        (false, false) => p[(i, j)],
        _ => 0.0,
    });
    close("several axes that were set", form.as_ref(), &c, &wanted, 1e-12)?;
    let mut c = covariance(form, p);
    c.scale(core::slice::from_ref(&(0..middle + 1)), 5.0);
    let d = DMatrix::from_fn(n, n, |i, j| match (i == j, i <= middle) {
        (true, true) => math::sqrt(5.0_f64),
        (true, false) => 1.0,
        _ => 0.0,
    });
    close("scaled blocks", form.as_ref(), &c, &(&d * p * &d), 1e-12)?;
    let mut whole = covariance(form, p);
    whole.scale(core::slice::from_ref(&(0..n)), 4.0);
    close("the whole scaled", form.as_ref(), &whole, &(p * 4.0), 1e-12)
}

type Noise = DMatrix<f64>;

/// A transition with noise on both sides of Φ; Φ, and the two noises, dense.
fn transition(layout: &Layout, slots: &[Slot<Scalar>], random: &mut Lcg) -> (Transition, DMatrix<f64>, Noise, Noise) {
    let n = slots.len();
    let mut t = Transition::new(layout);
    let (mut before, mut after) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
    for k in 0..n {
        let (i, j) = (k, (k * 5 + 1) % n);
        t.set(slots[i], slots[j], &Matrix1::new(random.signed()));
        let q = 0.1 + random.signed().abs();
        t.noise_trapezoid(slots[i], slots[i], &Matrix1::new(q));
        before[(i, i)] += 0.5 * q;
        after[(i, i)] += 0.5 * q;
    }
    if n > 1 {
        // Small compared with the diagonal: Q stays positive.
        t.noise(slots[0], slots[n - 1], &Matrix1::new(0.01));
        after[(0, n - 1)] += 0.01;
        after[(n - 1, 0)] += 0.01;
    }
    let phi = DMatrix::from_fn(n, n, |i, j| t.phi.get(i, j));
    (t, phi, before, after)
}

fn overflow(form: &Arc<dyn Form>, layout: &Layout, slots: &[Slot<Scalar>], p: &DMatrix<f64>) -> Result<(), String> {
    let last = slots[slots.len() - 1];
    for (element, noise) in [(1e160, 0.0), (f64::NAN, 0.0), (0.5, f64::INFINITY), (0.5, -1e6)] {
        let mut t = Transition::new(layout);
        t.set(slots[0], last, &Matrix1::new(element));
        // The same element twice, in a row that is not the first: its original value must come back.
        let middle = slots[slots.len() / 2];
        t.noise_trapezoid(middle, middle, &Matrix1::new(0.4));
        t.noise_trapezoid(middle, middle, &Matrix1::new(1.0 / 3.0));
        t.noise(last, last, &Matrix1::new(noise));
        let mut c = covariance(form, p);
        let before = c.clone();
        if c.predict(&t, &mut Workspace::new(form.as_ref(), slots.len(), 1)) || c != before {
            return Err(format!(
                "{}: Φ of {element} and Q of {noise} are not refused without a trace",
                form.name()
            ));
        }
    }
    Ok(())
}

/// An invalid covariance with a negative variance, as rounding might leave it, is reported and not predicted.
fn negative(form: &Arc<dyn Form>, layout: &Layout, slots: &[Slot<Scalar>], p: &DMatrix<f64>) -> Result<(), String> {
    let last = slots.len() - 1;
    let mut c = covariance(form, p);
    c.set_block(&layout.blocks()[last], &[-1e-9]);
    if c.is_sound() || c.sigmas(&layout.blocks()[last]).all(|sigma| !sigma.is_nan()) {
        return Err(format!("{}: a negative variance counts as sound, or has a sigma", form.name()));
    }
    let mut t = Transition::new(layout);
    t.set(slots[last], slots[last], &Matrix1::new(1.0));
    let before = c.clone();
    if c.predict(&t, &mut Workspace::new(form.as_ref(), slots.len(), 1)) || c != before {
        return Err(format!("{}: a negative variance is predicted on", form.name()));
    }
    Ok(())
}

/// A P that is no covariance although no variance is negative is reported; a singular P is
/// accepted.
fn indefinite(form: &Arc<dyn Form>, n: usize) -> Result<(), String> {
    let w = &mut Workspace::new(form.as_ref(), n, 1);
    let correlated = |by: f64| {
        let p = DMatrix::from_fn(n, n, |i, j| match (i.min(j), i.max(j)) {
            (i, j) if i == j => 1.0,
            (0, 1) => by,
            _ => 0.0,
        });
        covariance(form, &p)
    };
    for (by, is_one) in [(0.5, true), (1.0, true), (1.5, n < 2)] {
        if correlated(by).is_positive(w) != is_one {
            return Err(format!("{}: a correlation of {by} is judged wrongly", form.name()));
        }
    }
    Ok(())
}

/// Prediction and conditioning where P, Q and R have less than full rank.
fn singular(form: &Arc<dyn Form>, layout: &Layout, slots: &[Slot<Scalar>], random: &mut Lcg) -> Result<(), String> {
    let n = slots.len();
    // Rank one and two: only rounding is left after a factorisation.
    let g = DMatrix::from_fn(n, 2, |_, _| random.signed());
    let p = &g * g.transpose();
    let mut t = Transition::new(layout);
    let q = g.column(0) * g.column(0).transpose();
    for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        t.noise(slots[i], slots[j], &Matrix1::new(q[(i, j)]));
    }
    let mut c = covariance(form, &p);
    if !c.predict(&t, &mut Workspace::new(form.as_ref(), n, 1)) {
        return Err(format!("{}: a singular noise is refused", form.name()));
    }
    // 1e-7: a form that factors may treat a pivot of 1e-14 of a variance as rounding. An element next to
    // it is up to the square root of that.
    close("a prediction of singular P and Q", form.as_ref(), &c, &(p + q), 1e-7)?;
    let p = positive(n, random);
    let (mut c, mut w, mut h) = (covariance(form, &p), Workspace::new(form.as_ref(), n, 1), Jacobian::new(layout, 1));
    h.reset(1);
    slots
        .iter()
        .for_each(|slot| h.add(0, &Quantity::State(*slot), &Matrix1::new(random.signed())));
    condition(&mut c, &h, &[0.0], &mut w)?;
    let full = DMatrix::from_fn(1, n, |_, j| h.get(0, j));
    let hp = &full * &p;
    let wanted = &p - hp.transpose() * &hp / (&hp * full.transpose())[0];
    let off = (DMatrix::from_row_slice(n, n, &c.to_dense()) - wanted).amax() / p.amax();
    // 1e-12: rounding, as above, of what there was before.
    (off <= 1e-12)
        .then_some(())
        .ok_or_else(|| format!("{} n = {n}: a measurement without noise is off by {off:e}", form.name()))
}

/// Conditions on rows H with noise R, as a filter does.
fn condition(c: &mut Covariance, h: &Jacobian, r: &[f64], w: &mut Workspace) -> Result<(), String> {
    c.project(h, w);
    (0..r.len()).for_each(|k| w.s[k] = w.hph[k] + r[k]);
    if !cholesky(&w.s, &mut w.l, h.rows()) {
        return Err("S is not positive".to_owned());
    }
    w.gain(h.rows());
    c.condition(h, r, w);
    Ok(())
}

/// Projection and conditioning on `m` random rows with correlated noise.
fn conditioned(
    form: &Arc<dyn Form>,
    layout: &Layout,
    slots: &[Slot<Scalar>],
    p: &DMatrix<f64>,
    m: usize,
    random: &mut Lcg,
) -> Result<(), String> {
    let n = slots.len();
    let (mut c, mut w, mut h) = (covariance(form, p), Workspace::new(form.as_ref(), n, m), Jacobian::new(layout, m));
    h.reset(m);
    for (i, slot) in (0..m).flat_map(|i| slots.iter().map(move |s| (i, s))) {
        if random.signed() > 0.0 {
            h.add(i, &Quantity::State(*slot), &Matrix1::new(random.signed()));
        }
    }
    let (r, full) = (positive(m, random), DMatrix::from_fn(m, n, |i, j| h.get(i, j)));
    c.project(&h, &mut w);
    let (hp, hph) = (&full * p, &full * p * full.transpose());
    let is_close = |found: f64, wanted: f64| (found - wanted).abs() <= 1e-12 * (1.0 + hph.amax() + hp.amax());
    let projected =
        (0..m).all(|i| (0..m).all(|j| is_close(w.hph[i * m + j], hph[(i, j)])) && (0..n).all(|j| is_close(w.hp[i * w.ld + j], hp[(i, j)])));
    if !projected {
        return Err(format!("{}: HP or HPHᵀ of {m} rows is off", form.name()));
    }
    condition(&mut c, &h, &rows(&r), &mut w)?;
    let inverse = (&hph + &r).try_inverse().ok_or("S has no inverse")?;
    let wanted = p - hp.transpose() * inverse * &hp;
    // 1e-11: an inverse of condition about 100.
    close(&format!("conditioning on {m} rows"), form.as_ref(), &c, &wanted, 1e-11)
}

/// Nothing moves.
#[derive(Debug)]
struct Still;

impl Process for Still {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
}

/// z = A x.
#[derive(Debug)]
struct Linear(DMatrix<f64>, Vec<Slot<Scalar>>);

impl Measurement for Linear {
    fn size(&self) -> Size {
        Size::same(self.0.nrows())
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        for (i, v) in value.iter_mut().enumerate() {
            *v = self
                .1
                .iter()
                .enumerate()
                .map(|(j, s)| self.0[(i, j)] * at.get(&Quantity::State(*s)))
                .sum();
        }
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        for (j, slot) in self.1.iter().enumerate() {
            (0..self.0.nrows()).for_each(|i| h.add(i, &Quantity::State(*slot), &Matrix1::new(self.0[(i, j)])));
        }
        Ok(())
    }
}

/// An update rule is exact for a linear measurement, with every form: x + K r and (I − KH)P with
/// K = PHᵀS⁻¹, to 1e-11 of their size. It reports the residual, NIS and S of the prediction.
///
/// # Errors
/// A sentence naming the result that is wrong.
pub fn check_update_rule(rule: &Arc<dyn UpdateRule>) -> Result<(), String> {
    let kinds = [FormKind::Joseph, FormKind::Standard, FormKind::Udu, FormKind::SquareRoot];
    let sizes = [(1, 1), (4, 2), (15, 3)];
    for (kind, (n, m)) in kinds.iter().flat_map(|kind| sizes.map(|size| (kind, size))) {
        let mut random = Lcg::new((n * 100 + m) as u64);
        let (layout, slots) = scalars(n)?;
        let (p, r) = (positive(n, &mut random), positive(m, &mut random));
        let a = DMatrix::from_fn(m, n, |_, _| random.signed());
        let (x, z) = (
            DVector::from_fn(n, |_, _| random.signed()),
            DVector::from_fn(m, |_, _| random.signed()),
        );
        let form = kind.form();
        let parts = Parts {
            chart: Arc::new(Body),
            update: rule.clone(),
            form: form.clone(),
            reset: Reset::Plain,
            kernel: Kernel::default(),
            protection: false,
        };
        let mut filter = Filter::of(Arc::new(layout), Arc::new(Still), parts, Size::same(m));
        let mut belief = filter.belief().clone();
        belief.x.copy_from_slice(x.as_slice());
        belief.covariance = covariance(&form, &p);
        filter.set_belief(belief);
        let (model, noise) = (Linear(a.clone(), slots), rows(&r));
        let observed = Observed {
            sensor: 0,
            model: &model,
            value: z.as_slice(),
            noise: &noise,
            quality: None,
            derivative_input: None,
            lateness: None,
        };
        let update = filter.update(&observed, &mut Open, &[], &Quadratic);
        let residual = &z - &a * &x;
        let s = &a * &p * a.transpose() + &r;
        let inverse = s.clone().try_inverse().ok_or("S has no inverse")?;
        let gain = &p * a.transpose() * &inverse;
        let nis = (residual.transpose() * &inverse * &residual)[0];
        let near = |found: f64, wanted: f64| (found - wanted).abs() <= 1e-11 * (1.0 + wanted.abs());
        let name = rule.name();
        if update.verdict != Verdict::Accepted || !near(update.nis, nis) {
            return Err(format!("{name}: {:?} with a NIS of {} for {nis}", update.verdict, update.nis));
        }
        if !(0..m).all(|i| near(update.residual[i], residual[i]) && near(update.innovation_sigma[i], math::sqrt(s[(i, i)]))) {
            return Err(format!("{name}: the residual or S is not that of the prediction"));
        }
        let moved = &x + &gain * &residual;
        if !moved.iter().zip(&filter.belief().x).all(|(wanted, found)| near(*found, *wanted)) {
            return Err(format!("{name}: the state is not x + K r, n = {n}"));
        }
        let wanted = &p - &gain * &a * &p;
        close(name, form.as_ref(), &filter.belief().covariance, &wanted, 1e-11)?;
    }
    Ok(())
}
