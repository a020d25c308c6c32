//! The likelihood of innovations: how probable a filter held its measurements before it used them.
//!
//! ```text
//! ln L = Σ ln p(rₖ | Sₖ),   ln p(r | S) = −½ (ln |2πS| + rᵀ S⁻¹ r) for a sensor without a gate
//! ```
//!
//! A difference of ln L between two designs over the same rows says which one predicts the measurements better, in
//! nats. The rules of what counts are in one place, for results, comparisons and [tuning](crate::tune):
//!
//! - Sensors that measure: a constraint agrees with itself, and the rows of a stage repeat those of its inputs.
//! - All rows of a gated sensor, the rejected rows as well, with a density that has a tail.
//! - Rows from the alignment on. A filter that never aligned counts from its start.
//!
//! Source     Schweppe 1965 (IEEE TIT 11(1), 61): the likelihood of a linear system by its innovations

mod density;
mod difference;
mod section;

pub(crate) use density::{Density, between, product, whitened};
pub(crate) use difference::{BLOCKS, block, difference};
pub use difference::{Difference, Terms, differences};

use fusion::design::{Design, Named, SensorDesign};
use fusion_models::block::Reading;

/// The densities of the sensors of a design, in their order in the design; `None` for a sensor that does not count.
pub(crate) fn densities(design: &Design) -> Vec<Option<Density>> {
    densities_of(design, |sensor| is_real(design, sensor))
}

/// The densities of the sensors that measure by the rows of a stage; `None` for all others.
pub(crate) fn densities_of_stages(design: &Design) -> Vec<Option<Density>> {
    densities_of(design, |sensor| is_measured(sensor) && is_of_stage(design, sensor))
}

fn densities_of(design: &Design, counts: impl Fn(&Named<SensorDesign>) -> bool) -> Vec<Option<Density>> {
    let of = |sensor: &Named<SensorDesign>| {
        let density = match (&sensor.block.gate, &sensor.block.loss) {
            (None, None) => Density::Normal,
            _ => Density::WithOutliers,
        };
        counts(sensor).then_some(density)
    };
    design.sensors.iter().map(of).collect()
}

/// Whether a sensor has an instrument: its value comes with rows, and not from a stage, which holds them back and
/// repeats them.
pub(crate) fn is_real(design: &Design, sensor: &Named<SensorDesign>) -> bool {
    is_measured(sensor) && !is_of_stage(design, sensor)
}

/// Whether a sensor has a value that is measured. The value of a constraint is constant.
fn is_measured(sensor: &Named<SensorDesign>) -> bool {
    !matches!(sensor.block.model.reading(), Reading::Constant(_))
}

fn is_of_stage(design: &Design, sensor: &Named<SensorDesign>) -> bool {
    design.stages.iter().any(|stage| stage.name == sensor.block.common.source)
}
