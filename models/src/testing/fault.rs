//! Laws of faults, on a source of position, velocity, heading and attitude.

use crate::fault::{Fault, FaultContext, FaultSpec, ProvidedChannel, RowOutcome};
use crate::registry::Registration;
use crate::vocabulary::channel;
use fusion_core::time::Time;

/// A fault changes only the columns that it names, and reports for each row what it did. If it leaves a NaN, it is
/// intended: all the named columns are NaN. A new stamp, a delay or copies that it reports differ from those of the
/// row, and it then leaves the numbers unchanged. One seed gives one disturbance, and the example acts within 400 s.
/// Statistics of a gate count a row as disturbed by these reports.
pub(super) fn check(r: &Registration) -> Result<(), String> {
    let spec: Box<dyn FaultSpec> = r.spec()?;
    let mut offset = 0;
    let channels = [channel::POSITION, channel::VELOCITY, channel::HEADING, channel::ATTITUDE].map(|channel| {
        let at = offset;
        offset += channel.width;
        ProvidedChannel {
            channel,
            offset: at,
            delay_ns: 0,
        }
    });
    let built = || {
        let context = FaultContext {
            channels: &channels,
            seed: 4,
        };
        spec.build(&context)
            .map_err(|e| format!("its example does not build: {}: {e}", e.field))
    };
    let (mut fault, mut again) = (built()?, built()?);
    let mut seen = false;
    for k in 0..400_u32 {
        let time = Time::from_seconds(f64::from(k));
        let (row, outcome) = applied(fault.as_mut(), time, k)?;
        if applied(again.as_mut(), time, k)? != (row.clone(), outcome) {
            return Err(format!("row {k}: the same seed gives another disturbance"));
        }
        seen |= outcome != RowOutcome::Untouched;
        let is_wrong = matches!(outcome, RowOutcome::Disturbed | RowOutcome::Restamped { .. });
        if is_wrong && fault.columns().is_empty() {
            return Err(format!("row {k}: it says {outcome:?} and names no numbers that are wrong"));
        }
    }
    if seen {
        Ok(())
    } else {
        Err("its example does nothing in 400 s".to_owned())
    }
}

/// The bits of row `k` after the fault, and the outcome that the fault reports.
fn applied(fault: &mut dyn Fault, time: Time, k: u32) -> Result<(Vec<u64>, RowOutcome), String> {
    let clean = [0.7, -1.4, 200.0, 1.0, 2.0, 3.0, 0.5, 1.0, 0.0, 0.0, 0.0].map(|x| x + 1e-3 * f64::from(k));
    let (mut row, columns) = (clean, fault.columns());
    let outcome = fault.apply(time, &mut row);
    let changed: Vec<usize> = (0..row.len()).filter(|i| row[*i] != clean[*i]).collect();
    if let Some(other) = changed.iter().find(|i| !columns.contains(i)) {
        return Err(format!("row {k}: it changes number {other} and names {columns:?}"));
    }
    if changed.is_empty() == (outcome == RowOutcome::Disturbed) {
        return Err(format!("row {k}: it changes the numbers {changed:?} and says {outcome:?}"));
    }
    if row.iter().any(|v| !v.is_finite()) && !row[columns].iter().all(|v| v.is_nan()) {
        return Err(format!("row {k}: it leaves {row:?}"));
    }
    if matches!(
        outcome,
        RowOutcome::Restamped { by: 0 } | RowOutcome::Repeated { copies: 0 } | RowOutcome::Delayed { by: ..=0 }
    ) {
        return Err(format!("row {k}: {outcome:?} is nothing"));
    }
    Ok((row.map(f64::to_bits).to_vec(), outcome))
}
