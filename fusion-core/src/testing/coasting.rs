//! Laws of processes that continue without input.

use super::numeric::finite;
use super::process::{check_noise, check_steps, check_transition};
use crate::linear::Transition;
use crate::math;
use crate::model::{Gap, Input, Process, SignalBuffer};
use crate::state::Layout;

/// The coasting of a process, as a separate process.
#[derive(Debug)]
struct Coasting<'a> {
    process: &'a dyn Process,
    layout: &'a Layout,
    /// Where in the gap it coasts \[s\].
    from: f64,
    /// The motion at the beginning of the gap.
    motion: &'a [f64],
}

impl Coasting<'_> {
    fn step(&self, x: &mut [f64], dt: f64, sample: &mut [f64], out: &mut Transition) -> bool {
        let (from, to) = (self.from, self.from + dt);
        self.process.coast(x, &Gap { from, to }, self.motion, sample, out)
    }
}

impl Process for Coasting<'_> {
    fn input_dim(&self) -> usize {
        0
    }
    fn propagate(&self, x: &mut [f64], _: &Input<'_>, dt: f64) {
        let mut sample = vec![0.0; self.process.input_dim()];
        self.step(x, dt, &mut sample, &mut Transition::new(self.layout));
    }
    fn linearise(&self, x: &[f64], _: &Input<'_>, dt: f64, out: &mut Transition) {
        let mut sample = vec![0.0; self.process.input_dim()];
        self.step(&mut x.to_vec(), dt, &mut sample, out);
        out.settle(|_| 0.0);
    }
}

/// A motion at the beginning of the gap, in the numbers of [`Process::motion`].
const MOTION: [f64; 8] = [0.3, -0.2, 0.5, 1.0, -2.0, 0.7, 0.4, -0.6];

/// At the beginning of a gap and after ten seconds, coasting obeys the law of processes with input. Its noise grows
/// with the gap, on the same axes. And the input that it reports moves the process in the same way.
///
/// # Errors
/// A sentence naming the blocks.
pub fn check_coasting(layout: &Layout, process: &dyn Process, x: &[f64], dt: f64) -> Result<(), String> {
    let (nothing, dt) = (Input::held(&[]), dt.min(process.max_step()));
    let mut sample = vec![0.0; process.input_dim()];
    let mut coasted = x.to_vec();
    let gap = Gap { from: 0.0, to: dt };
    if process.input_dim() == 0 || !process.coast(&mut coasted, &gap, &MOTION, &mut sample, &mut Transition::new(layout)) {
        return Ok(());
    }
    for (from, motion) in [(0.0, &MOTION[..]), (10.0, &MOTION), (0.0, &[])] {
        let coasting = Coasting {
            process,
            layout,
            from,
            motion,
        };
        let of = |why: String| format!("coasting from {from} s: {why}");
        check_steps(layout, &coasting, x, &nothing, dt).map_err(of)?;
        check_noise(layout, &coasting, x, &nothing, dt).map_err(of)?;
        check_transition(layout, &coasting, x, &nothing, dt).map_err(of)?;
    }
    finite("the input while coasting", &sample)?;
    let mut signals = SignalBuffer::new(layout);
    signals.evaluate(process, &coasted, &Input::held(&sample), false);
    finite("a signal while coasting", &signals.values)?;
    let mut driven = x.to_vec();
    process.propagate(&mut driven, &Input::held(&sample), dt);
    let (mut apart, mut moved) = (vec![0.0; layout.dim()], vec![0.0; layout.dim()]);
    layout.minus(&driven, &coasted, &mut apart);
    layout.minus(&coasted, x, &mut moved);
    let norm = |v: &[f64]| math::sqrt(v.iter().map(|v| v * v).sum::<f64>());
    // The input belongs to the end of the step: second order in dt. By then gravity has turned, ½g|w| = 3, and the
    // force, ½|w||f| = 0.7, and it has faded, ½|f|/τ = 1.2 for a second. 1e-9: rounding of a position.
    let limit = (6.0 + norm(&moved)) * dt * dt + 1e-9;
    if norm(&apart) > limit {
        return Err(format!(
            "the input while coasting moves the state {:e} away from where it coasts",
            norm(&apart)
        ));
    }
    check_growth(layout, process, x, dt)
}

/// The noise of a long part of a gap is larger than the noise of a short part, on the same axes.
fn check_growth(layout: &Layout, process: &dyn Process, x: &[f64], dt: f64) -> Result<(), String> {
    let diagonal = |to: f64| {
        let mut t = Transition::new(layout);
        let mut sample = vec![0.0; process.input_dim()];
        process.coast(&mut x.to_vec(), &Gap { from: 0.0, to }, &MOTION, &mut sample, &mut t);
        t.settle(|_| 0.0);
        let mut q = vec![0.0; layout.dim()];
        for (i, j, value) in t.noise_before().chain(t.noise_after()) {
            q[i] += if i == j { value } else { 0.0 };
        }
        q
    };
    let (short, long) = (diagonal(0.5 * dt), diagonal(dt));
    if !short.iter().any(|q| *q > 0.0) {
        return Err("coasting adds no noise".to_owned());
    }
    match short.iter().zip(&long).position(|(s, l)| *s > 0.0 && l <= s) {
        Some(axis) => Err(format!("the noise of coasting does not grow with the gap on axis {axis}")),
        None => Ok(()),
    }
}
