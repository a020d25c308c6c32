//! Findings about estimated parameters.

use super::Finding;
use super::facts::Facts;
use fusion::run::FinalState;
use fusion_tables::{Unit, short};

/// A parameter is not identifiable if its final 1σ is more than this share of its initial 1σ.
const LEARNT: f64 = 0.9;

impl Facts<'_> {
    /// A parameter that moved further from its initial value than its initial 1σ allows, and is still there at the end.
    /// The flag says whether it belongs to the input.
    pub(super) fn far_parameter(&self) -> Option<(bool, Finding)> {
        let own = self.run.health?;
        let mut reasons = own.transitions.last().filter(|_| own.further_transitions == 0)?.reasons.iter();
        let name = &reasons.find(|r| r.reason == "calibration")?.of;
        let sensor = self
            .instruments
            .iter()
            .find(|i| name.strip_prefix(i.name.as_str()).is_some_and(|rest| rest.starts_with('.')));
        let parts = match sensor {
            Some(sensor) => {
                let key = name.rsplit('.').next().unwrap_or_default();
                format!("the {} of `{}`", sensor.parts_but(key), sensor.name)
            }
            None => "the axes, signs and units of the input of the process".to_owned(),
        };
        let finding = Finding {
            about: name.clone(),
            evidence: format!("`{name}` has gone far from its initial value, for the `sigma` that it began with"),
            advice: format!("look at {parts}; if they are right, `{name}` is worse known than declared: widen its `sigma`"),
            ..Finding::of("parameter-far")
        };
        Some((sensor.is_none(), finding))
    }

    /// Parameters that are not identifiable: none of their 1σ decreased.
    pub(super) fn unlearnt(&self) -> Option<Finding> {
        let unlearnt = || self.run.parameters.iter().filter(|p| is_unlearnt(p));
        let about = unlearnt().next()?.name.clone();
        let each = unlearnt().map(|p| {
            let unit = Unit::of_si(p.unit);
            let mut known: Vec<String> = Vec::new();
            for (start, end) in p.start_sigma.iter().zip(&p.sigma).filter(|(start, _)| **start > 0.0) {
                let both = format!("{} at the start, {} at the end", short(unit.of(*start)), short(unit.of(*end)));
                if !known.contains(&both) {
                    known.push(both);
                }
            }
            format!("`{}` (1σ [{}] {})", p.name, unit.symbol(), known.join("; "))
        });
        let evidence = format!("the data told nothing of {}", each.collect::<Vec<_>>().join(", "));
        let advice = "a motion or a sensor that shows it is missing; without one, give the value with `estimate = false`";
        Some(Finding {
            about,
            evidence,
            advice: advice.to_owned(),
            ..Finding::of("parameter-unlearnt")
        })
    }
}

/// Returns true if the 1σ of a parameter decreased on no axis.
fn is_unlearnt(p: &FinalState) -> bool {
    let mut axes = p.start_sigma.iter().zip(&p.sigma).filter(|(start, _)| **start > 0.0).peekable();
    axes.peek().is_some() && axes.all(|(start, end)| *end >= LEARNT * start)
}
