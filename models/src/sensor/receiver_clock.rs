//! The clock of a GNSS receiver as states: offset and drift, in metres and metres per second.
//!
//! States   `NAME.clock_offset` b, `NAME.clock_drift` d; ḃ = d + w_b, ḋ = w_d
//! Shared   a second sensor of the same receiver reads them by `{ shared = "NAME.clock_drift" }`
//! Source   Groves 2013, §9.4.2; Brown and Hwang 2012, §9.3

#![cfg(feature = "declare")]

use crate::block::{Build, BuildError};
use crate::param::{Estimated, ParamSpec, ParamValue, ScalarParam};
use crate::units::dim;
use fusion_core::state::{Declaration, Dynamics, Param, Scalar, StateRole};

/// The drift, as a state that is an error of the sensor.
pub(super) fn drift(b: &mut Build<'_>, spec: &ScalarParam<dim::Speed>) -> Result<Param<Scalar>, BuildError> {
    match spec {
        ParamSpec::Estimated(e) => declare(b, "clock_drift", e, e.dynamics().map_err(|e| e.within("clock_drift"))?),
        other => b.param("clock_drift", other),
    }
}

/// The offset, which the drift moves if it is a state. The drift is declared by the way.
pub(super) fn offset(
    b: &mut Build<'_>,
    offset: &ScalarParam<dim::Length>,
    drift_spec: &ScalarParam<dim::Speed>,
) -> Result<Param<Scalar>, BuildError> {
    let rate = match drift_spec {
        ParamSpec::Fixed(value) if value.si() == 0.0 => None,
        ParamSpec::Fixed(_) => {
            let message = "a drift that is not zero moves the clock, and must be a state";
            return Err(BuildError::at("clock_drift", message).help("write `{ estimate = true, initial = …, sigma = … }`"));
        }
        ParamSpec::Shared(name) => Some(name.clone()),
        ParamSpec::Estimated(_) => Some(format!("{}.clock_drift", b.name)),
    };
    drift(b, drift_spec)?;
    match (offset, rate) {
        (ParamSpec::Estimated(e), Some(rate)) => {
            let psd = match e.dynamics().map_err(|e| e.within("clock_offset"))? {
                Dynamics::RandomWalk { psd } => psd,
                Dynamics::Constant => vec![0.0],
                _ => {
                    let message = "an offset that a drift moves has no correlation time";
                    return Err(BuildError::at("clock_offset.correlation_time", message).help("remove it, or `clock_drift`"));
                }
            };
            declare(b, "clock_offset", e, Dynamics::Integral { rate, psd })
        }
        (ParamSpec::Estimated(e), None) => declare(b, "clock_offset", e, e.dynamics().map_err(|e| e.within("clock_offset"))?),
        (other, None) => b.param("clock_offset", other),
        (_, Some(_)) => {
            let message = "the drift moves a `clock_offset` that this sensor estimates, and here it is not estimated";
            Err(BuildError::at("clock_drift", message).help("remove `clock_drift`: the owner of the offset has it"))
        }
    }
}

fn declare<V: ParamValue<Manifold = Scalar>>(
    b: &mut Build<'_>,
    field: &str,
    estimated: &Estimated<V>,
    dynamics: Dynamics,
) -> Result<Param<Scalar>, BuildError> {
    let owner = b.name.to_owned();
    let declared = Declaration {
        name: format!("{owner}.{field}"),
        owner,
        unit: V::SYMBOL,
        initial: estimated.initial.value(),
        sigma: V::axes(&estimated.sigma),
        role: StateRole::Nuisance,
        dynamics,
    };
    let slot = b.layout.declare::<Scalar>(declared);
    slot.map(Param::State).map_err(|e| BuildError::at(field, e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::earth::Gravity;
    use fusion_core::state::LayoutBuilder;
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Clock {
        #[serde(default)]
        clock_offset: ScalarParam<dim::Length>,
        #[serde(default)]
        clock_drift: ScalarParam<dim::Speed>,
    }

    /// The dynamics of the offset, or the field of a mistake.
    fn built(text: &str) -> Result<Dynamics, String> {
        let clock: Clock = toml::from_str(text).unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "gps",
            layout: &mut layout,
            origin: None,
            gravity: Gravity::default(),
        };
        offset(&mut build, &clock.clock_offset, &clock.clock_drift).map_err(|e| e.field)?;
        Ok(layout
            .finish()
            .block("gps.clock_offset")
            .map_or(Dynamics::Constant, |b| b.dynamics.clone()))
    }

    #[test]
    fn a_drift_moves_an_estimated_offset_and_no_other() {
        let offset = "clock_offset = { estimate = true, initial = 0, sigma = 10, random_walk = 2 }\n";
        let drift = "clock_drift = { estimate = true, initial = 0, sigma = 1 }";
        let rate = "gps.clock_drift".to_owned();
        assert_eq!(built(&format!("{offset}{drift}")), Ok(Dynamics::Integral { rate, psd: vec![4.0] }));
        assert_eq!(built(offset), Ok(Dynamics::RandomWalk { psd: vec![4.0] }));
        assert_eq!(built(""), Ok(Dynamics::Constant));
        assert_eq!(built(&format!("{offset}clock_drift = 3")), Err("clock_drift".to_owned()));
        assert_eq!(built(drift), Err("clock_drift".to_owned()));
        let markov = "clock_offset = { estimate = true, initial = 0, sigma = 10, correlation_time = 5 }\n";
        assert_eq!(built(&format!("{markov}{drift}")), Err("clock_offset.correlation_time".to_owned()));
    }
}
