//! Laws of measurement models.

use super::numeric::{column, finite, within};
use crate::linear::Jacobian;
use crate::model::{Input, Measurement, Process, SignalBuffer, Size};
use crate::state::{Layout, View};

/// h is finite, and its Jacobian agrees with central differences through the layout's ⊞ (with the
/// signals of `process` evaluated at every point). perturb is the inverse of residual. The prediction repeats the given
/// numbers, and perturb keeps them. A model reads signals only
/// if it declares so. Parts agree with their rows of the whole, and obey the same laws.
///
/// # Errors
/// A sentence naming the block, row and axis; also where the model is undefined at `x`.
pub fn check_measurement(
    layout: &Layout,
    process: Option<&dyn Process>,
    model: &dyn Measurement,
    x: &[f64],
    input: &Input<'_>,
) -> Result<(), String> {
    let Size { value, residual: m } = model.size();
    let mut signals = SignalBuffer::new(layout);
    let mut predict = |x: &[f64], z: &mut [f64], with_jacobian: bool| -> Result<SignalBuffer, String> {
        if let Some(process) = process {
            signals.evaluate(process, x, input, with_jacobian);
        }
        model
            .predict(&signals.view(x).with_given(model.given()), z)
            .map_err(|e| e.to_string())?;
        Ok(signals.clone())
    };
    let mut z = vec![0.0; value];
    let at = predict(x, &mut z, true)?;
    finite("the prediction", &z)?;
    if model.given_in(&z) != model.given() {
        return Err("the prediction does not repeat the given numbers at its end".to_owned());
    }
    let mut h = Jacobian::new(layout, m);
    h.reset(m);
    model
        .jacobian(&at.view(x).with_given(model.given()), &mut h)
        .map_err(|e| e.to_string())?;
    h.chain(&at.jacobian);
    unread_signals(layout, model, x, &z)?;
    let noise = rounding(model, &z, m);
    for b in layout.blocks() {
        // Rounding of metres comes out in the units of z, as steeply as its steepest axis.
        let steepest = b.tangent_range().flat_map(|j| (0..m).map(move |i| (i, j)));
        let of_block = steepest.fold(0.0, |most: f64, (i, j)| most.max(h.get(i, j).abs()));
        let steepest = of_block.max(1.0);
        for k in 0..b.kind.dim() {
            let numeric = column(layout, b, k, x, m, &mut |x, out| {
                let mut moved = vec![0.0; value];
                predict(x, &mut moved, false)?;
                model.residual(&moved, &z, out);
                Ok(())
            })?;
            let analytic: Vec<f64> = (0..m).map(|i| h.get(i, b.tangent + k)).collect();
            finite(&format!("the Jacobian by `{}`", b.name), &analytic)?;
            let scale = analytic.iter().chain(&numeric.value).fold(0.0, |m: f64, v| m.max(v.abs()));
            let rounding = 8.0 * noise / numeric.step;
            // 1e-7: differences of Earth-centred coordinates round to a few 1e-9 m.
            if numeric.doubt > 1e-2 * scale + (100.0 * rounding).max(1e-7 * steepest / numeric.step) {
                return Err(format!("`{}`, axis {k}: h is too rough here for a numeric derivative", b.name));
            }
            // A millionth of the block's steepest axis: metres at a lever arm for metres at the body.
            let tolerance = 1e-6 * scale.max(of_block) + numeric.doubt + rounding;
            for (i, (analytic, numeric)) in analytic.iter().zip(&numeric.value).enumerate() {
                if !within(analytic - numeric, tolerance) {
                    return Err(format!(
                        "∂h/∂`{}` is wrong at row {i}, axis {k}: analytic {analytic:e}, numeric {numeric:e} (tolerance {tolerance:.1e})",
                        b.name
                    ));
                }
            }
        }
    }
    for (row, whole) in z.iter().enumerate().take(m) {
        let Some(part) = model.part(row) else { break };
        let mut own = [0.0];
        if part.size() != Size::same(1) {
            return Err(format!("part {row} is not one row"));
        }
        part.predict(&at.view(x).with_given(part.given()), &mut own)
            .map_err(|e| e.to_string())?;
        if own[0] != *whole {
            return Err(format!("part {row} predicts {}, and its row of the whole {whole}", own[0]));
        }
        check_measurement(layout, process, part.as_ref(), x, input).map_err(|e| format!("part {row}: {e}"))?;
    }
    round_trip(model, &z, m)
}

/// A model that reads no signals predicts `z` for any signals.
fn unread_signals(layout: &Layout, model: &dyn Measurement, x: &[f64], z: &[f64]) -> Result<(), String> {
    if model.reads_signals() {
        return Ok(());
    }
    let (unknown, mut predicted) = (vec![f64::NAN; layout.signal_storage()], vec![0.0; z.len()]);
    let view = View::new(x, &unknown).with_given(model.given());
    model.predict(&view, &mut predicted).map_err(|e| e.to_string())?;
    if predicted == z {
        Ok(())
    } else {
        Err("it reads signals, and `reads_signals` says that it does not".to_owned())
    }
}

/// The change of the residual for one ulp of each number of z: 3e-9 m for a longitude. At least
/// ε, because direction cosines round in between.
fn rounding(model: &dyn Measurement, z: &[f64], m: usize) -> f64 {
    let (mut moved, mut r, mut noise) = (z.to_vec(), vec![0.0; m], f64::EPSILON);
    for k in 0..z.len() {
        moved[k] += f64::EPSILON * z[k].abs().max(1e-3);
        model.residual(&moved, z, &mut r);
        noise = r.iter().fold(noise, |n, r| n.max(r.abs()));
        moved[k] = z[k];
    }
    noise
}

/// residual(perturb(z, e), z) = e.
fn round_trip(model: &dyn Measurement, z: &[f64], m: usize) -> Result<(), String> {
    let given = model.given_in(z).to_vec();
    for size in [0.0, 1e-3, 0.3] {
        let e: Vec<f64> = (0..m).map(|i| if i % 2 == 0 { size } else { -0.7 * size }).collect();
        let (mut moved, mut back) = (z.to_vec(), vec![0.0; m]);
        model.perturb(&mut moved, &e);
        if model.given_in(&moved) != given {
            return Err("perturb changes the given numbers".to_owned());
        }
        model.residual(&moved, z, &mut back);
        // 1e-8: geodetic metres; elsewhere the rounding of z itself.
        let tolerance = 1e-8 + 4.0 * f64::EPSILON * z.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        if let Some(i) = (0..m).find(|&i| !within(back[i] - e[i], tolerance)) {
            return Err(format!("residual(perturb(z, e), z) is {} in row {i} instead of {}", back[i], e[i]));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Undefined;
    use crate::state::{Angle, Declaration, Dynamics, LayoutBuilder, Manifold, Position, Quantity, Scalar, Slot, StateRole};
    use nalgebra::{RowVector3, Vector3};

    /// The distance from the origin, its slope off by a factor, its errors undone wrongly.
    #[derive(Debug)]
    struct Distance {
        position: Quantity<Position>,
        factor: f64,
        undone: f64,
    }

    impl Measurement for Distance {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value[0] = at.get(&self.position).norm();
            Ok(())
        }
        fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
            let p = at.get(&self.position);
            h.add(
                0,
                &self.position,
                &RowVector3::new(p.x / p.norm(), p.y / p.norm() * self.factor, p.z / p.norm()),
            );
            Ok(())
        }
        fn perturb(&self, z: &mut [f64], e: &[f64]) {
            z[0] += self.undone * e[0];
        }
    }

    fn law(factor: f64, undone: f64) -> Result<(), String> {
        fn declare<M: Manifold>(b: &mut LayoutBuilder, name: &str, initial: M::Value) -> Slot<M> {
            let (name, owner, sigma) = (name.to_owned(), String::new(), vec![1.0; M::KIND.dim()]);
            b.declare::<M>(Declaration {
                name,
                owner,
                unit: "",
                initial,
                sigma,
                role: StateRole::Kinematic,
                dynamics: Dynamics::Process,
            })
            .unwrap()
        }
        let mut b = LayoutBuilder::new();
        declare::<Angle>(&mut b, "unread", 3.0);
        let position = declare::<Position>(&mut b, "place", Vector3::new(30.0, -40.0, 20.0)).into();
        let layout = b.finish();
        check_measurement(
            &layout,
            None,
            &Distance { position, factor, undone },
            layout.initial(),
            &Input::held(&[]),
        )
    }

    #[test]
    fn a_true_jacobian_passes_and_one_off_by_a_hundred_thousandth_is_named() {
        law(1.0, 1.0).unwrap();
        let message = law(1.000_01, 1.0).unwrap_err();
        assert!(message.contains("`place`") && message.contains("row 0, axis 1"), "{message}");
    }

    /// A signal, read in secret.
    #[derive(Debug)]
    struct Secret(Quantity<Scalar>, bool);

    impl Measurement for Secret {
        fn size(&self) -> Size {
            Size::same(1)
        }
        fn reads_signals(&self) -> bool {
            self.1
        }
        fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
            value[0] = at.get(&self.0);
            Ok(())
        }
        fn jacobian(&self, _: &View<'_>, _: &mut Jacobian) -> Result<(), Undefined> {
            Ok(())
        }
    }

    #[test]
    fn a_signal_that_is_read_in_secret_is_seen() {
        let mut b = LayoutBuilder::new();
        let signal = b.signal::<Scalar>("signal").unwrap();
        let layout = b.finish();
        let law = |tells: bool| {
            let model = Secret(Quantity::Signal(signal), tells);
            check_measurement(&layout, None, &model, &[], &Input::held(&[]))
        };
        law(true).unwrap();
        assert!(law(false).unwrap_err().contains("reads_signals"));
    }

    #[test]
    fn an_error_that_the_residual_does_not_undo_is_seen() {
        assert!(law(1.0, 0.9).unwrap_err().contains("perturb"));
    }
}
