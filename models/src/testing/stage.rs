//! Laws of stages, on every registered process that they can be built for.

use super::rows::Motion;
use super::{Bench, build, state};
use crate::block::StageSpec;
use crate::registry::{self, Registration, Role};
use fusion_core::model::{Input, SignalBuffer};
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::View;
use fusion_core::testing::{Lcg, check_memory};
use fusion_core::time::Time;

/// The number of rows on each input, 100 per second.
const ROWS: i32 = 1500;

/// A stage must emit rows of its declared width, in order and not before the row that it has just seen. The numbers
/// must be finite, even if its input is not. A second stage with the memory of the first continues bit for bit. The
/// stage must emit at least one row.
pub(super) fn check(r: &Registration) -> Result<(), String> {
    let (mut refusals, mut accepted, mut emitted) = (String::new(), 0, 0);
    for p in registry::all().into_iter().filter(|p| p.role == Role::Process) {
        let mut bench = Bench::new(p).map_err(|e| format!("process `{}`: {e}", p.name))?;
        let spec: Box<dyn StageSpec> = r.spec()?;
        match spec.build(&mut build(r.name, &mut bench.layout)) {
            Ok(_) => {
                accepted += 1;
                for motion in Motion::ALL {
                    emitted +=
                        feed(r.name, spec.as_ref(), &mut bench, motion).map_err(|e| format!("on process `{}`, {motion:?}: {e}", p.name))?;
                }
            }
            Err(e) => refusals += &format!("\n{}: {e}", p.name),
        }
    }
    match (accepted, emitted) {
        (0, _) => Err(format!("no process suits it:{refusals}")),
        (_, 0) => Err("it emits nothing, at rest or on the move".to_owned()),
        _ => Ok(()),
    }
}

/// The rows that a stage emits, each as time and numbers.
fn emitted(stage: &mut dyn Stage, input: usize, time: Time, row: &[f64], view: Option<&View<'_>>) -> Vec<(Time, Vec<f64>)> {
    let mut out = Emitter::default();
    stage.row(input, time, row, view, &mut out);
    out.rows().map(|(time, row)| (time, row.to_vec())).collect()
}

/// The number of rows that the stage emits during the motion.
fn feed(name: &str, spec: &dyn StageSpec, bench: &mut Bench, motion: Motion) -> Result<usize, String> {
    let mut made = || spec.build(&mut build(name, &mut bench.layout)).map_err(|e| e.to_string());
    let (mut stage, mut twin) = (made()?, made()?);
    let width: usize = spec.output().iter().map(|c| c.width).sum();
    let layout = bench.layout.so_far();
    let mut random = Lcg::new(11);
    let (x, sample) = (state(layout, &mut random), bench.sample(&mut random)?);
    let mut signals = SignalBuffer::new(layout);
    signals.evaluate(bench.process.as_ref(), &x, &Input::held(&sample), false);
    let view = signals.view(&x);
    let (mut last, mut count) = (Time::MIN, 0);
    for k in 0..ROWS {
        let time = Time::from_seconds(0.01 * f64::from(k));
        if k % 90 == 0 {
            check_memory(stage.as_mut(), twin.as_mut()).map_err(|e| format!("before row {k}: {e}"))?;
        }
        for (input, listen) in spec.inputs().iter().enumerate() {
            let mut row = motion.row(&listen.channels, time.seconds(), &mut random);
            // The filter has not started in the first second; a row may be lost.
            let view = (k >= 100).then_some(&view);
            if k % 500 == 499 {
                row.fill(f64::NAN);
            }
            let rows = emitted(stage.as_mut(), input, time, &row, view);
            if rows != emitted(twin.as_mut(), input, time, &row, view) {
                return Err(format!("at row {k} of input {input} one with its memory emits other rows"));
            }
            for (at, numbers) in rows {
                if numbers.len() != width {
                    return Err(format!("it emits {} numbers and declares {width}", numbers.len()));
                }
                if !numbers.iter().all(|v| v.is_finite()) {
                    return Err(format!("it emits {numbers:?} at row {k} of input {input}"));
                }
                if at < time || at < last {
                    return Err(format!("it emits a row of {at} at {time}, after one of {last}"));
                }
                last = at;
                count += 1;
            }
        }
    }
    Ok(count)
}
