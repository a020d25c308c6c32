//! Wild values at random.

use super::random::generator;
use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{AnyQuantity, PerAxis, Probability, range};
use core::ops::Range;
use fusion_core::math;
use fusion_core::time::Time;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use schemars::JsonSchema;

/// Some rows get an error of random size and direction.
///
/// The error of a position is horizontal, that of a vector has any direction, that of a single
/// number either sign, that of an attitude any axis.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutliersSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// Share of the rows that are outliers.
    rate: Probability,
    /// The smallest and the largest error, uniformly distributed between them; metres for a
    /// position, an angle for an attitude.
    size: [AnyQuantity; 2],
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "outliers",
    OutliersSpec,
    r#"
channel = "position"
rate = "10 %"
size = ["20 m", "100 m"]
"#
);

#[typetag::deserialize(name = "outliers")]
impl FaultSpec for OutliersSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let size = PerAxis::Each(self.size.to_vec()).si::<range::NonNegative>(&[target.dimension(); 2]);
        let size = size.map_err(|e| BuildError::quantity("size", &e))?;
        let (least, greatest) = (size[0], size[1]);
        if least > greatest {
            let error = BuildError::at("size", "the least size is greater than the greatest");
            return Err(error.help("write `size = [least, greatest]`"));
        }
        let by = vec![0.0; target.outlier_degrees()];
        let (rate, window, seed) = (self.rate.si(), self.window.clone(), context.seed);
        Ok(Box::new(Outliers {
            target,
            rate,
            least,
            greatest,
            by,
            window,
            seed,
        }))
    }
}

#[derive(Debug)]
struct Outliers {
    target: Target,
    rate: f64,
    least: f64,
    greatest: f64,
    by: Vec<f64>,
    window: Windows,
    seed: u64,
}

impl Fault for Outliers {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        let mut random = generator(self.seed, time);
        if !self.window.contains(time) || random.random::<f64>() >= self.rate {
            return RowOutcome::Untouched;
        }
        let size = self.least + (self.greatest - self.least) * random.random::<f64>();
        direction(&mut random, &mut self.by);
        self.by.iter_mut().for_each(|x| *x *= size);
        self.target.displace(row, &self.by);
        RowOutcome::Disturbed
    }
}

/// A unit vector of any direction, uniformly: Gaussian numbers have none that is preferred.
fn direction(random: &mut impl Rng, unit: &mut [f64]) {
    for _ in 0..8 {
        unit.iter_mut().for_each(|x| *x = random.sample(StandardNormal));
        let norm = math::sqrt(unit.iter().map(|x| x * x).sum::<f64>());
        if norm > 1e-6 {
            unit.iter_mut().for_each(|x| *x /= norm);
            return;
        }
    }
    unit.fill(0.0);
    unit[..1].fill(1.0);
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;
    use fusion_core::geometry::so3;
    use fusion_core::geometry::wgs84::Geodetic;
    use nalgebra::{Vector3, Vector4};

    const N: i64 = 4000;

    /// The rows that were disturbed.
    fn wild(channel: &str, size: &str) -> Vec<[f64; 11]> {
        let mut fault = build::<OutliersSpec>(&format!("channel = '{channel}'\nrate = 0.25\nsize = {size}"), 5).unwrap();
        let mut one = |k: i64| {
            let mut row = ROW;
            (fault.apply(Time::from_nanos(k * 250_000_000), &mut row) == RowOutcome::Disturbed).then_some(row)
        };
        (0..N).filter_map(&mut one).collect()
    }

    #[test]
    fn a_position_errs_horizontally_in_all_directions_by_the_declared_size() {
        let truth = Geodetic {
            lat: ROW[0],
            lon: ROW[1],
            height: ROW[2],
        };
        let rows = wild("position", "['20 m', 100]");
        // 1000 ± 27 (1σ of the binomial): 5σ.
        assert!(rows.len().abs_diff(1000) < 137, "{}", rows.len());
        let errors: Vec<Vector3<f64>> = rows
            .iter()
            .map(|r| {
                Geodetic {
                    lat: r[0],
                    lon: r[1],
                    height: r[2],
                }
                .difference(&truth)
            })
            .collect();
        // 1 cm: the metres of a displacement and of a difference are taken at two latitudes.
        assert!(errors.iter().all(|e| e.z == 0.0 && (19.99..100.01).contains(&e.norm())));
        let mean = errors.iter().map(|e| e.xy().normalize()).sum::<nalgebra::Vector2<f64>>() / errors.len() as f64;
        // The mean of n unit vectors in a plane has 1σ = 1/√(2n) = 0.022 per axis: 5σ.
        assert!(mean.amax() < 0.11, "{mean}");
    }

    #[test]
    fn vectors_angles_and_attitudes_err_in_their_own_space() {
        let off = |r: &[f64; 11]| Vector3::new(r[3] - 1.0, r[4] - 2.0, r[5] - 3.0).norm();
        assert!(wild("velocity", "[3, 3]").iter().all(|r| (off(r) - 3.0).abs() < 1e-12));
        let ups = wild("heading", "['90 deg', '90 deg']").iter().filter(|r| r[6] > 0.5).count();
        assert!(ups.abs_diff(500) < 137, "{ups}");
        let turn = |r: &[f64; 11]| so3::log(&so3::from_scalar_first(&Vector4::from_column_slice(&r[7..11]))).norm();
        assert!(
            wild("attitude", "['20 deg', '20 deg']")
                .iter()
                .all(|r| (turn(r) - 20f64.to_radians()).abs() < 1e-12)
        );
    }

    #[test]
    fn sizes_in_the_wrong_order_are_refused() {
        let said = build::<OutliersSpec>("channel = 'velocity'\nrate = 0.1\nsize = [2, 1]", 1).unwrap_err();
        let expected = "size: the least size is greater than the greatest / write `size = [least, greatest]`";
        assert_eq!(said, expected);
        let said = build::<OutliersSpec>("channel = 'velocity'\nrate = 0.1\nsize = [-1, 1]", 1).unwrap_err();
        assert!(said.contains("-1 is out of range"), "{said}");
    }
}
