//! The Earth's magnetic field, measured as a vector in body axes.
//!
//! Measured   z = raw field \[T\], body axes
//! Predicted  h(x) = A⁻¹ C_nbᵀ m_n + b,  m_n = F (cos I cos D, cos I sin D, sin I): strength F,
//!            inclination I below the horizon, declination D clockwise from true north;
//!            A soft iron, b hard iron, as in the stage `compass`: m = A (z − b)
//! Jacobian   ∂h/∂δφ_b = A⁻¹ [C_nbᵀ m_n ×],  ∂h/∂b = I₃,  ∂h/∂(F, I, D) = A⁻¹ C_nbᵀ ∂m_n/∂(F, I, D)
//! Field      declared, estimated, or of the World Magnetic Model at the origin of the run
//!            ([`crate::earth::magnetic`])
//! Valid      if all other fields move with the body. Indoors this is not so: estimate strength and
//!            inclination there, so that they give no information on the tilt
//! Not here   a field that differs from place to place; the stage `compass` has a gate for it
//! Source     the derivative of C_nbᵀ m_n with C_nb ← C_nb Exp(δφ_b); Gebre-Egziabher et al. 2006
//!            (J. Aerosp. Eng. 19) for hard and soft iron

use crate::earth::magnetic::EarthField;
use fusion_core::geometry::so3::skew;
use fusion_core::linear::Jacobian;
use fusion_core::literal;
use fusion_core::model::{Literal, Measurement, Size, Undefined};
use fusion_core::state::{Attitude, Param, Quantity, Scalar, Vector, View};
use nalgebra::{Matrix3, Vector3};

/// The runtime model.
#[derive(Debug, Literal)]
pub struct Magnetometer {
    attitude: Quantity<Attitude>,
    strength: Param<Scalar>,
    inclination: Param<Scalar>,
    declination: Param<Scalar>,
    hard_iron: Param<Vector<3>>,
    /// A⁻¹.
    distortion: Matrix3<f64>,
}

impl Magnetometer {
    fn field(&self, at: &View<'_>) -> EarthField {
        EarthField {
            strength: at.get(&self.strength),
            inclination: at.get(&self.inclination),
            declination: at.get(&self.declination),
        }
    }
}

impl Measurement for Magnetometer {
    fn size(&self) -> Size {
        Size::same(3)
    }

    fn predict(&self, at: &View<'_>, value: &mut [f64]) -> Result<(), Undefined> {
        let m_b = at.get(&self.attitude).inverse_transform_vector(&self.field(at).vector());
        let z = self.distortion * m_b + at.get(&self.hard_iron);
        value.copy_from_slice(z.as_slice());
        Ok(())
    }

    fn jacobian(&self, at: &View<'_>, h: &mut Jacobian) -> Result<(), Undefined> {
        let (q, field) = (at.get(&self.attitude), self.field(at));
        let m_b = q.inverse_transform_vector(&field.vector());
        h.add(0, &self.attitude, &(self.distortion * skew(&m_b)));
        h.add(0, &self.hard_iron, &Matrix3::identity());
        let along = |slope: &Vector3<f64>| self.distortion * q.inverse_transform_vector(slope);
        let [by_strength, by_inclination, by_declination] = field.slopes();
        h.add(0, &self.strength, &along(&by_strength));
        h.add(0, &self.inclination, &along(&by_inclination));
        h.add(0, &self.declination, &along(&by_declination));
        Ok(())
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Reading, SensorSpec, XYZ};
    use crate::de::DeserializeSpec;
    use crate::earth::magnetic::{self};
    use crate::param::{ParamSpec, ScalarParam, VectorParam};
    use crate::units::{Angle, Dimension, Dimensional, Quantity as Unit, Vec3Of, dim};
    use crate::vocabulary::{channel, state};
    use schemars::JsonSchema;

    /// A three-axis magnetometer: the Earth's field in body axes, with the body's own field.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct MagnetometerSpec {
        /// Strength of the Earth's field. `date` can replace it, `inclination` and `declination`.
        strength: Option<ScalarParam<dim::MagneticField>>,
        /// Angle of the Earth's field below the horizon.
        inclination: Option<ScalarParam<dim::Angle>>,
        /// Direction of magnetic north, clockwise from true north.
        declination: Option<ScalarParam<dim::Angle>>,
        /// A day, "2026-11-22": all undeclared values of the field are those of the World Magnetic Model at the origin of
        /// the run on this day. Needs the cargo feature `wmm`.
        date: Option<String>,
        /// Magnetic field of the body itself.
        #[serde(default)]
        hard_iron: VectorParam<dim::MagneticField>,
        /// A of m = A (m_raw − hard_iron), row by row.
        #[serde(default = "crate::stage::compass::no_soft_iron")]
        soft_iron: [Vec3Of<dim::Ratio>; 3],
    }

    crate::register!(
        Sensor,
        "magnetometer",
        MagnetometerSpec,
        r#"
strength = { estimate = true, initial = "50 uT", sigma = "2 uT" }
inclination = { estimate = true, initial = "51 deg", sigma = "2 deg" }
declination = "-8 deg"
hard_iron = { estimate = true, initial = [0, 0, 0], sigma = "3 uT", correlation_time = "1000 s" }
soft_iron = [[1.02, 0, 0.01], [0, 0.99, 0], [0.01, 0, 1]]
"#
    );

    #[typetag::deserialize(name = "magnetometer")]
    impl SensorSpec for MagnetometerSpec {
        fn reading(&self) -> Reading {
            Reading::Channel(channel::MAGNETIC_FIELD)
        }

        fn noise(&self) -> Vec<Dimension> {
            vec![dim::MagneticField::KIND.dimension; 3]
        }

        fn axes(&self) -> &'static [&'static str] {
            XYZ
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError> {
            let model = match &self.date {
                Some(date) => Some(magnetic::world_model(&b.origin()?, date).map_err(|why| BuildError::at("date", why))?),
                None => None,
            };
            let soft_iron = Matrix3::from_rows(&self.soft_iron.map(|row| Vector3::from(row.si()).transpose()));
            let distortion = soft_iron
                .try_inverse()
                .ok_or_else(|| BuildError::at("soft_iron", "this matrix has no inverse: it maps some field to none"))?;
            let strength = declared(&self.strength, model.map(|m| Unit::from_si(m.strength)));
            let inclination = declared(&self.inclination, model.map(|m| Angle::from_si(m.inclination)));
            let declination = declared(&self.declination, model.map(|m| Angle::from_si(m.declination)));
            let (Some(strength), Some(inclination), Some(declination)) = (strength, inclination, declination) else {
                return Err(self.missing());
            };
            if strength.initial().is_some_and(|f| f <= 0.0) {
                return Err(BuildError::at("strength", "the strength of the field must be greater than 0")
                    .help("write e.g. \"48 uT\", the total intensity where you are"));
            }
            Ok(Box::new(Magnetometer {
                attitude: b.quantity(state::ATTITUDE)?,
                strength: b.param("strength", &strength)?,
                inclination: b.param("inclination", &inclination)?,
                declination: b.param("declination", &declination)?,
                hard_iron: b.param("hard_iron", &self.hard_iron)?,
                distortion,
            }))
        }
    }

    impl MagnetometerSpec {
        /// The error for values that are neither declared nor known.
        fn missing(&self) -> BuildError {
            let all = [
                ("`strength`", self.strength.is_none()),
                ("`inclination`", self.inclination.is_none()),
                ("`declination`", self.declination.is_none()),
            ];
            let missing: Vec<&str> = all.iter().filter(|(_, is_missing)| *is_missing).map(|(field, _)| *field).collect();
            BuildError::new(format!("missing {} of the Earth's field", missing.join(", "))).help(
                "declare them as calculators of the World Magnetic Model give them for your place and year, such as NOAA's; or a `date`, \
                 in a program that was built with `--features wmm`",
            )
        }
    }

    /// The declared value, or the value of the World Magnetic Model.
    fn declared<D: Dimensional + core::fmt::Debug>(param: &Option<ScalarParam<D>>, model: Option<Unit<D>>) -> Option<ScalarParam<D>> {
        param.clone().or_else(|| model.map(ParamSpec::Fixed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, SensorSpec};
    use crate::earth::Gravity;
    use fusion_core::geometry::so3;
    use fusion_core::state::{Declaration, Dynamics, LayoutBuilder, StateRole};
    use nalgebra::UnitQuaternion;

    fn built(toml: &str, q: UnitQuaternion<f64>) -> Result<[f64; 3], String> {
        let mut layout = LayoutBuilder::new();
        let declaration = Declaration {
            name: "attitude".to_owned(),
            owner: String::new(),
            unit: "rad",
            initial: q,
            sigma: vec![0.0; 3],
            role: StateRole::Kinematic,
            dynamics: Dynamics::Process,
        };
        layout.declare::<Attitude>(declaration).unwrap();
        let spec: MagnetometerSpec = toml::from_str(toml).map_err(|e| e.to_string())?;
        let mut build = Build {
            name: "magnetometer",
            layout: &mut layout,
            origin: Some(fusion_core::geometry::wgs84::Geodetic::new(80_f64.to_radians(), 0.0, 0.0)),
            gravity: Gravity::default(),
        };
        let model = spec.build(&mut build).map_err(|e| format!("{}: {e}", e.field))?;
        let (layout, mut z) = (layout.finish(), [0.0; 3]);
        model.predict(&View::new(layout.initial(), &[]), &mut z).unwrap();
        Ok(z)
    }

    #[test]
    fn the_compass_stage_takes_out_what_the_magnetometer_puts_in() {
        let iron = "hard_iron = [3e-6, -8e-6, 1e-6]\nsoft_iron = [[1.1, 0.02, 0], [0.02, 0.9, -0.01], [0, -0.01, 1]]";
        let field = "strength = '45 uT'\ninclination = '63 deg'\ndeclination = '-8 deg'";
        let q = so3::from_rpy(0.3, -0.2, 2.5);
        let z = built(&format!("{field}\n{iron}"), q).unwrap();
        let soft = Matrix3::new(1.1, 0.02, 0.0, 0.02, 0.9, -0.01, 0.0, -0.01, 1.0);
        let m = crate::stage::compass::field::calibrated(&Vector3::from(z), &soft, &Vector3::new(3e-6, -8e-6, 1e-6));
        let seen = crate::stage::compass::field::field(&m, &q, (-8_f64).to_radians());
        // 1e-12: an inverse of a 3×3 matrix and trigonometric functions; 1e-17 T of 45e-6.
        assert!(seen.turn.abs() < 1e-12 && (seen.dip.to_degrees() - 63.0).abs() < 1e-10, "{seen:?}");
        assert!((seen.magnitude - 45e-6).abs() < 1e-17, "{seen:?}");
    }

    #[test]
    fn what_a_field_lacks_is_said() {
        let q = UnitQuaternion::identity();
        let message = built("strength = '45 uT'\ndeclination = 0", q).unwrap_err();
        assert!(message.contains("missing `inclination`"), "{message}");
        let rest = "inclination = 1\ndeclination = 0";
        let message = built(&format!("strength = '0 uT'\n{rest}"), q).unwrap_err();
        assert!(message.contains("greater than 0"), "{message}");
        let flat = format!("strength = '45 uT'\n{rest}\nsoft_iron = [[1, 0, 0], [0, 1, 0], [1, 1, 0]]");
        assert!(built(&flat, q).unwrap_err().contains("no inverse"));
    }

    #[cfg(not(feature = "wmm"))]
    #[test]
    fn without_the_feature_a_date_is_refused_with_the_reason() {
        let message = built("date = '2020-01-01'", UnitQuaternion::identity()).unwrap_err();
        assert!(message.starts_with("date") && message.contains("--features wmm"), "{message}");
    }

    #[cfg(feature = "wmm")]
    #[test]
    fn with_a_date_the_field_is_that_of_the_world_magnetic_model() {
        let z = built("date = '2020-01-01'", UnitQuaternion::identity()).unwrap();
        // NOAA's WMM2020_TEST_VALUES.txt at 80° north, 0° east, height 0. 0.15 nT: the last digit is 0.1 nT, and
        // single precision another 0.05 nT of 55 µT.
        let printed = [6570.4e-9, -146.3e-9, 54606.0e-9];
        assert!((0..3).all(|i| (z[i] - printed[i]).abs() < 0.15e-9), "{z:?}");
        let declared = built("date = '2020-01-01'\ndeclination = 0", UnitQuaternion::identity()).unwrap();
        assert!(
            declared[1].abs() < 1e-15,
            "a declared value counts before the model's: {declared:?}"
        );
    }
}
