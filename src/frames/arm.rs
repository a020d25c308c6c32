//! A declared lever arm against the one that the design's own filter estimates in its place.

use super::judge::{Comparison, Judged};
use crate::config::{Diagnostic, Diagnostics};
use crate::design::{Design, Named, SensorDesign};
use crate::run::{Options, Smoothing, examine, run};
use fusion_models::units::{Vec3Of, dim};

/// What every sensor calls it.
const ARM: &str = "lever_arm";
/// Of an arm shorter than this nothing is said \[m\].
const SHORTEST: f64 = 0.1;
/// An estimate that is this many σ on the other side of zero has another sign. The σ is the filter's own, which takes
/// its noise for white; latencies that are not declared move an estimate by several σ.
const CERTAIN: f64 = 10.0;

/// Estimates the arms that a design declares, and compares.
pub(super) fn judge(design: &Design, options: &Options, found: &mut Judged) -> Result<(), Diagnostics> {
    let arms: Vec<(&Named<SensorDesign>, [f64; 3])> = design.sensors.iter().filter_map(|s| Some((s, declared(s)?))).collect();
    if arms.is_empty() {
        return Ok(());
    }
    let mut document = design.document.clone();
    for (sensor, arm) in &arms {
        let length = arm.iter().map(|l| l * l).sum::<f64>().sqrt();
        // Wide enough for the mirrored arm, and finite along axes that no motion tells.
        let sigma = 2.0 * length;
        let set = format!(
            "sensor.{}.{ARM}={{ estimate = true, initial = {}, sigma = \"{sigma} m\" }}",
            sensor.name,
            written(arm)
        );
        document.set(&set)?;
    }
    let free = examine::build(document)?;
    let options = Options {
        data: options.data.clone(),
        base: options.base.clone(),
        seed: options.seed,
        smooth: Smoothing::Never,
        ..Options::default()
    };
    let summary = run(&free, &options, &mut |_| {})?;
    for (sensor, arm) in arms {
        let name = format!("{}.{ARM}", sensor.name);
        let Some(state) = summary.parameters.iter().find(|p| p.name == name) else {
            continue;
        };
        compare(sensor, &arm, &state.value, &state.sigma, found);
    }
    Ok(())
}

/// An arm that is not shared with another sensor, and long enough.
fn declared(sensor: &Named<SensorDesign>) -> Option<[f64; 3]> {
    let node = sensor.node.get(ARM)?;
    let node = node.get("initial").unwrap_or(node);
    let arm: Vec3Of<dim::Length> = node.read(&mut Diagnostics::new())?;
    let arm = arm.si();
    arm.iter().any(|l| l.abs() >= SHORTEST).then_some(arm)
}

/// An arm as it is written in TOML.
fn written(arm: &[f64; 3]) -> String {
    let each: Vec<String> = arm.iter().map(|l| format!("\"{l} m\"")).collect();
    format!("[{}]", each.join(", "))
}

fn compare(sensor: &Named<SensorDesign>, arm: &[f64; 3], estimate: &[f64], sigma: &[f64], found: &mut Judged) {
    let away = |i: usize| -estimate[i] * arm[i].signum() / sigma[i];
    let is_mirrored = |i: &usize| arm[*i].abs() >= SHORTEST && away(*i) > CERTAIN && estimate[*i].abs() > arm[*i].abs() / 2.0;
    let mirrored: Vec<usize> = (0..3).filter(is_mirrored).collect();
    let margin = (0..3).filter(|i| arm[*i].abs() >= SHORTEST).map(away).fold(0.0, f64::max);
    let listed = |values: &[f64]| values.iter().map(|v| format!("{v:.2}")).collect::<Vec<_>>().join(", ");
    let words = format!("[{}] m, 1σ [{}] m", listed(estimate), listed(sigma));
    found.comparisons.push(Comparison {
        what: format!("{}.{ARM}", sensor.name),
        with: "the estimate of this filter".to_owned(),
        samples: 0,
        correlation: Vec::new(),
        margin,
        verdict: if mirrored.is_empty() {
            words.clone()
        } else {
            format!("another sign: {words}")
        },
    });
    if mirrored.is_empty() {
        return;
    }
    let axes: Vec<&str> = mirrored.iter().map(|i| ["x", "y", "z"][*i]).collect();
    let mut other = *arm;
    mirrored.iter().for_each(|i| other[*i] = -other[*i]);
    let message = format!(
        "the lever arm of `{}` has the wrong sign along {}: where it is estimated, it becomes {words}",
        sensor.name,
        axes.join(" and ")
    );
    let place = sensor.node.place_of(ARM);
    let key = if sensor.node.at(&format!("{ARM}.initial")).is_some() {
        "initial"
    } else {
        ARM
    };
    let help = format!(
        "it points from the body origin to the sensor, forward, right, down: try `{key} = {}`",
        written(&other)
    );
    found.mistakes.push(Diagnostic::warning(message).at(place).help(help));
}
