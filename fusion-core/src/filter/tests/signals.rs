//! Signals of the process: of which state and which input they are when a model reads them.

use super::*;
use crate::model::SignalsOut;
use crate::state::{Quantity, Signal};

/// A bias, and the signal "input less bias".
#[derive(Debug)]
struct Corrected {
    bias: Slot<Scalar>,
    signal: Signal<Scalar>,
}

impl Process for Corrected {
    fn input_dim(&self) -> usize {
        1
    }
    fn propagate(&self, _: &mut [f64], _: &Input<'_>, _: f64) {}
    fn linearise(&self, _: &[f64], _: &Input<'_>, _: f64, _: &mut Transition) {}
    fn signals(&self, x: &[f64], input: &Input<'_>, out: &mut SignalsOut<'_>) {
        out.set(self.signal, &(input.sample[0] - self.bias.read(x)));
        out.add(self.signal, self.bias, &Matrix1::new(-1.0));
    }
}

/// z = the signal.
#[derive(Debug)]
struct Reads(Quantity<Scalar>);

impl Measurement for Reads {
    fn size(&self) -> Size {
        Size::same(1)
    }
    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        value[0] = at.get(&self.0);
        Ok(())
    }
    fn jacobian(&self, _: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        h.add(0, &self.0, &Matrix1::new(1.0));
        Ok(())
    }
}

fn corrected() -> (Filter, Slot<Scalar>, Reads) {
    let mut b = LayoutBuilder::new();
    let bias = declare::<Scalar>(&mut b, "bias", 0.0, &[1.0], Dynamics::Constant);
    let signal = b.signal::<Scalar>("corrected").unwrap();
    (filter(b, Corrected { bias, signal }, 1), bias, Reads(Quantity::Signal(signal)))
}

#[test]
fn signals_are_those_of_the_latest_input() {
    let (mut f, _, model) = corrected();
    for (k, input) in [(1, 5.0), (2, 7.0), (3, -2.0)] {
        f.predict(second(k), &Input::held(&[input])).unwrap();
        assert_eq!(f.view().get(&model.0), input);
        // An update whose noise hides what it measures.
        assert!((accept(&mut f, &model, &[input], &[1e12]).predicted[0] - input).abs() < 1e-9);
    }
}

#[test]
fn signals_are_renewed_after_an_update_and_after_a_belief_is_set() {
    let (mut f, bias, model) = corrected();
    f.predict(second(1), &Input::held(&[5.0])).unwrap();
    // H = −1, P = 1, R = 1: half of the residual of −4 goes to the bias.
    let update = accept(&mut f, &model, &[1.0], &[1.0]);
    assert_eq!((update.predicted[0], update.residual[0]), (5.0, -4.0));
    // 1e-14: rounding of the gain.
    assert!((bias.read(&f.belief().x) - 2.0).abs() < 1e-14);
    assert!((f.view().get(&model.0) - 3.0).abs() < 1e-14);
    assert!((accept(&mut f, &model, &[1.0], &[1.0]).predicted[0] - 3.0).abs() < 1e-14);
    let mut belief = f.belief().clone();
    bias.write(&-1.0, &mut belief.x);
    f.set_belief(belief);
    assert_eq!(f.view().get(&model.0), 6.0);
}
