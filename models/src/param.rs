//! Calibration parameters as TOML declares them: the file alone decides if they are fixed or estimated.
//!
//! ```toml
//! lever_arm = ["10 cm", 0, "-1 m"]                                                # fixed
//! lever_arm = { estimate = true, initial = [0.1, 0, -1], sigma = "20 cm" }        # a constant state
//! bias = { estimate = true, initial = [0, 0, 0], sigma = "2 m", correlation_time = "60 s" } # Gauss-Markov
//! bias = { estimate = true, initial = [0, 0, 0], sigma = "1 m", random_walk = "1 cm/sqrt(s)" }
//! bias = { estimate = true, initial = [0, 0, 0], sigma = "1 m", random_walk = ["1 cm/sqrt(s)", 0, 0] }
//! lever_arm = { shared = "gnss_position.lever_arm" }                              # another block's state
//! ```

#![cfg(feature = "declare")]

use crate::error::BuildError;
use crate::units::{Angle, Axes, Dimension, Dimensional, NonNegative, PerAxis, Positive, Quantity, QuantityKind, Vec3Of, dim, range};
use core::f64::consts::TAU;
use core::fmt::{self, Debug};
use core::marker::PhantomData;
use fusion_core::geometry::so3;
use fusion_core::state::{Attitude, Dynamics, Manifold, Scalar, Vector};
use nalgebra::{UnitQuaternion, Vector3};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{DeserializeOwned, Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;

/// The value of a parameter as written in TOML, and the manifold it lives on.
pub trait ParamValue: Copy + Debug + DeserializeOwned + JsonSchema {
    /// The manifold of the state it becomes when estimated.
    type Manifold: Manifold;
    /// How many numbers are written for it.
    const COUNT: usize;
    /// How its 1σ is written.
    type Sigma: Copy + Debug + DeserializeOwned + JsonSchema;
    /// The dimension of a tangent coordinate.
    const KIND: QuantityKind;
    /// The unit of a tangent coordinate.
    const SYMBOL: &'static str = Self::KIND.symbol;
    /// The value as models read it.
    fn value(&self) -> <Self::Manifold as Manifold>::Value;
    /// The numbers that are written, in SI.
    fn numbers(&self) -> Vec<f64>;
    /// 1σ per tangent axis.
    fn axes(sigma: &Self::Sigma) -> Vec<f64>;
}

impl<D: Dimensional + Debug> ParamValue for Quantity<D> {
    type Manifold = Scalar;
    type Sigma = NonNegative<D>;
    const COUNT: usize = 1;
    const KIND: QuantityKind = D::KIND;
    fn value(&self) -> f64 {
        self.si()
    }
    fn numbers(&self) -> Vec<f64> {
        vec![self.si()]
    }
    fn axes(sigma: &Self::Sigma) -> Vec<f64> {
        vec![sigma.si()]
    }
}

impl<D: Dimensional + Debug> ParamValue for Vec3Of<D> {
    type Manifold = Vector<3>;
    type Sigma = Axes<D, range::NonNegative>;
    const COUNT: usize = 3;
    const KIND: QuantityKind = D::KIND;
    fn value(&self) -> Vector3<f64> {
        Vector3::from(self.si())
    }
    fn numbers(&self) -> Vec<f64> {
        self.si().to_vec()
    }
    fn axes(sigma: &Self::Sigma) -> Vec<f64> {
        sigma.si().to_vec()
    }
}

/// A rotation written as roll, pitch, yaw; estimated as an attitude block.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(transparent)]
pub struct Rpy(Vec3Of<dim::Angle>);

impl Rpy {
    /// From roll, pitch, yaw in radians.
    #[must_use]
    pub fn from_radians(rpy: [f64; 3]) -> Self {
        Self(rpy.map(Angle::from_si).into())
    }

    /// The rotation: x_outer = q · x_inner for the ZYX sequence.
    #[must_use]
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = self.0.si();
        so3::from_rpy(roll, pitch, yaw)
    }
}

impl ParamValue for Rpy {
    type Manifold = Attitude;
    type Sigma = Axes<dim::Angle, range::NonNegative>;
    const COUNT: usize = 3;
    const KIND: QuantityKind = dim::Angle::KIND;
    fn value(&self) -> UnitQuaternion<f64> {
        self.rotation()
    }
    fn numbers(&self) -> Vec<f64> {
        self.0.si().to_vec()
    }
    fn axes(sigma: &Self::Sigma) -> Vec<f64> {
        sigma.si().to_vec()
    }
}

/// A scalar parameter of dimension `D`.
pub type ScalarParam<D> = ParamSpec<Quantity<D>>;
/// A parameter of three axes of dimension `D`.
pub type VectorParam<D> = ParamSpec<Vec3Of<D>>;
/// A rotation as a parameter.
pub type RotationParam = ParamSpec<Rpy>;

/// A parameter: fixed, estimated, or shared with another block.
#[derive(Clone, Debug)]
pub enum ParamSpec<V: ParamValue> {
    /// A constant.
    Fixed(V),
    /// A separate state.
    Estimated(Estimated<V>),
    /// The state of this name, which another block declares.
    Shared(String),
}

impl<V: ParamValue + Default> Default for ParamSpec<V> {
    fn default() -> Self {
        Self::Fixed(V::default())
    }
}

impl<V: ParamValue> ParamSpec<V> {
    /// The fixed or initial value; `None` for a shared one.
    #[must_use]
    pub fn initial(&self) -> Option<<V::Manifold as Manifold>::Value> {
        match self {
            Self::Fixed(v) => Some(v.value()),
            Self::Estimated(e) => Some(e.initial.value()),
            Self::Shared(_) => None,
        }
    }

    /// Returns true if the parameter is its own state with a correlation time.
    pub(crate) const fn is_correlated(&self) -> bool {
        matches!(self, Self::Estimated(e) if e.correlation_time.is_some())
    }

    /// Returns true if the parameter is a state.
    #[must_use]
    pub const fn is_state(&self) -> bool {
        !matches!(self, Self::Fixed(_))
    }
}

/// An estimated parameter.
#[derive(Clone, Debug)]
pub struct Estimated<V: ParamValue> {
    /// Initial value.
    pub initial: V,
    /// Initial 1σ; with a correlation time also the stationary 1σ.
    pub sigma: V::Sigma,
    random_walk: Option<PerAxis>,
    correlation_time: Option<Positive<dim::Duration>>,
}

/// The exponent of 1/√s; exponents of seconds count in halves.
const PER_ROOT_SECOND: i8 = -1;

impl<V: ParamValue> Estimated<V> {
    /// Its own dynamics, or the key and the reason of an invalid combination.
    pub(crate) fn dynamics(&self) -> Result<Dynamics, BuildError> {
        let sigma = V::axes(&self.sigma);
        let axes = vec![per_root_second(V::KIND.dimension); sigma.len()];
        let walk = match &self.random_walk {
            Some(walk) => walk
                .si::<range::NonNegative>(&axes)
                .map_err(|e| BuildError::quantity("random_walk", &e))?,
            None => Vec::new(),
        };
        match (walk.iter().any(|w| *w != 0.0), &self.correlation_time) {
            (false, None) => Ok(Dynamics::Constant),
            (false, Some(tau)) => Ok(Dynamics::GaussMarkov { sigma, tau: tau.si() }),
            (true, None) => Ok(Dynamics::RandomWalk {
                psd: walk.iter().map(|w| w * w).collect(),
            }),
            (true, Some(_)) => {
                let both = BuildError::at("random_walk", "a state is a random walk or Gauss-Markov, not both");
                Err(both.help("remove `random_walk`, or `correlation_time`"))
            }
        }
    }
}

/// The dimension of the random walk of a quantity with dimension `d`.
#[must_use]
pub fn per_root_second(d: Dimension) -> Dimension {
    let root = dim::Duration::KIND.dimension.power(PER_ROOT_SECOND);
    root.and_then(|root| d.times(root)).unwrap_or(d)
}

/// The table form of a parameter.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound = "V: ParamValue")]
#[schemars(bound = "V: ParamValue")]
struct Table<V: ParamValue> {
    /// Makes the parameter a state of the filter.
    estimate: Option<bool>,
    /// The initial value of the state, or the constant if `estimate = false`.
    initial: Option<V>,
    /// Initial 1σ; with `correlation_time` also the stationary 1σ.
    sigma: Option<V::Sigma>,
    /// Makes the state a random walk of this density. The unit is that of the parameter per sqrt(s). One value holds
    /// for all axes, or an array has one per axis; 0 for no random walk.
    random_walk: Option<PerAxis>,
    /// Makes the state first-order Gauss-Markov with this correlation time.
    correlation_time: Option<Positive<dim::Duration>>,
    /// Uses the state of this name, which another block estimates.
    shared: Option<String>,
}

impl<V: ParamValue> Table<V> {
    fn into_spec(self) -> Result<ParamSpec<V>, String> {
        if let Some(name) = self.shared {
            if self.estimate.is_some() || self.initial.is_some() || self.sigma.is_some() {
                return Err("a shared parameter takes everything from its owner; remove the other keys".to_owned());
            }
            return Ok(ParamSpec::Shared(name));
        }
        let Some(initial) = self.initial else {
            return Err("missing `initial`: the value the filter starts from".to_owned());
        };
        let fixed = fixed(initial).map_err(|why| format!("`initial`: {why}"))?;
        match (self.estimate, self.sigma) {
            (Some(false), _) => Ok(fixed),
            (Some(true), Some(sigma)) => {
                within_a_turn(V::KIND.dimension, &V::axes(&sigma)).map_err(|why| format!("`sigma`: {why}"))?;
                Ok(ParamSpec::Estimated(Estimated {
                    initial,
                    sigma,
                    random_walk: self.random_walk,
                    correlation_time: self.correlation_time,
                }))
            }
            (Some(true), None) => Err("missing `sigma`: how uncertain the initial value is (1σ)".to_owned()),
            (None, _) => Err("missing `estimate = true` (a state) or `estimate = false` (a constant)".to_owned()),
        }
    }
}

/// The parameter with this constant value.
fn fixed<V: ParamValue>(value: V) -> Result<ParamSpec<V>, String> {
    within_a_turn(V::KIND.dimension, &value.numbers()).map(|()| ParamSpec::Fixed(value))
}

/// No angle of a parameter is larger than a turn: a larger angle was written in degrees.
fn within_a_turn(dimension: Dimension, si: &[f64]) -> Result<(), String> {
    let is_angle = dimension == dim::Angle::KIND.dimension;
    match si.iter().find(|angle| is_angle && angle.abs() > TAU) {
        None => Ok(()),
        Some(angle) => Err(format!(
            "an angle of {angle} rad is {:.1} turns; without a unit it is in radians: write \"{angle} deg\" for degrees",
            angle.abs() / TAU
        )),
    }
}

impl<'de, V: ParamValue> Deserialize<'de> for ParamSpec<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ParamVisitor(PhantomData))
    }
}

struct ParamVisitor<V>(PhantomData<V>);

impl<'de, V: ParamValue> Visitor<'de> for ParamVisitor<V> {
    type Value = ParamSpec<V>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, example) = (V::KIND, V::KIND.example);
        match V::COUNT {
            1 => write!(
                f,
                "{kind}, e.g. {example:?}, or {{ estimate = true, initial = {example:?}, sigma = {example:?} }}"
            ),
            n => {
                let each = vec![example; n];
                write!(
                    f,
                    "an array of {n}, each {kind}, e.g. {each:?}, or {{ estimate = true, initial = {each:?}, sigma = {example:?} }}"
                )
            }
        }
    }

    fn visit_f64<E: Error>(self, v: f64) -> Result<Self::Value, E> {
        V::deserialize(v.into_deserializer()).and_then(|v| fixed(v).map_err(E::custom))
    }

    fn visit_i64<E: Error>(self, v: i64) -> Result<Self::Value, E> {
        V::deserialize(v.into_deserializer()).and_then(|v| fixed(v).map_err(E::custom))
    }

    fn visit_u64<E: Error>(self, v: u64) -> Result<Self::Value, E> {
        V::deserialize(v.into_deserializer()).and_then(|v| fixed(v).map_err(E::custom))
    }

    fn visit_str<E: Error>(self, v: &str) -> Result<Self::Value, E> {
        V::deserialize(v.into_deserializer()).and_then(|v| fixed(v).map_err(E::custom))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        V::deserialize(SeqAccessDeserializer::new(seq)).and_then(|v| fixed(v).map_err(A::Error::custom))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let table = Table::<V>::deserialize(MapAccessDeserializer::new(map))?;
        table.into_spec().map_err(A::Error::custom)
    }
}

impl<V: ParamValue> JsonSchema for ParamSpec<V> {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        format!("ParamOf{}", V::schema_name()).into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let fixed = generator.subschema_for::<V>();
        let table = Table::<V>::json_schema(generator);
        json_schema!({ "anyOf": [fixed, table] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize)]
    struct Holder {
        bias: VectorParam<dim::Length>,
    }

    #[derive(Debug, Deserialize)]
    struct Turned {
        yaw: ScalarParam<dim::Angle>,
        #[serde(default, rename = "mounting")]
        _mounting: RotationParam,
    }

    fn dynamics(text: &str) -> Result<Dynamics, String> {
        let holder: Holder = toml::from_str(&format!("bias = {{ estimate = true, initial = [0, 0, 0], sigma = 2{text} }}")).unwrap();
        let ParamSpec::Estimated(estimated) = holder.bias else {
            return Err("it is no state".to_owned());
        };
        estimated.dynamics().map_err(|e| format!("{}: {}", e.field, e.message))
    }

    #[test]
    fn a_walk_of_nothing_is_none_so_that_a_variant_can_take_it_away() {
        assert_eq!(dynamics(""), Ok(Dynamics::Constant));
        assert_eq!(dynamics(", random_walk = 0"), Ok(Dynamics::Constant));
        let markov = Dynamics::GaussMarkov {
            sigma: vec![2.0; 3],
            tau: 60.0,
        };
        assert_eq!(dynamics(", random_walk = 0, correlation_time = '60 s'"), Ok(markov));
        assert_eq!(dynamics(", random_walk = 3"), Ok(Dynamics::RandomWalk { psd: vec![9.0; 3] }));
        assert_eq!(dynamics(", random_walk = [0, 0, 0]"), Ok(Dynamics::Constant));
        assert!(
            dynamics(", random_walk = 3, correlation_time = '60 s'")
                .unwrap_err()
                .contains("not both")
        );
    }

    #[test]
    fn an_angle_in_degrees_without_its_unit_is_refused() {
        let read = |text: &str| {
            toml::from_str::<Turned>(&format!("yaw = {text}"))
                .map(|t| t.yaw)
                .map_err(|e| e.to_string())
        };
        let refused = |text: &str| read(text).map_or_else(|e| e, |_| String::new());
        assert!(read("'170 deg'").is_ok() && read("3.1").is_ok());
        let whole = "an angle of 170 rad is 27.1 turns; without a unit it is in radians: write \"170 deg\" for degrees";
        assert!(refused("170").contains(whole), "{}", refused("170"));
        let state = |initial: &str, sigma: &str| refused(&format!("{{ estimate = true, initial = {initial}, sigma = {sigma} }}"));
        assert!(state("170", "1").contains("`initial`: an angle of 170 rad"));
        assert!(state("1", "100").contains("`sigma`: an angle of 100 rad"));
        assert!(toml::from_str::<Turned>("yaw = 0\nmounting = [0, 0, 90]").is_err());
    }

    #[test]
    fn each_axis_may_walk_by_its_own_density() {
        let each = dynamics(", random_walk = ['3 m/sqrt(s)', 2, 0]");
        assert_eq!(each, Ok(Dynamics::RandomWalk { psd: vec![9.0, 4.0, 0.0] }));
        let refused = |text: &str| dynamics(&format!(", random_walk = {text}")).unwrap_err();
        assert!(refused("[1, '2 m', 3]").starts_with("random_walk.1: \"2 m\" is a length [m]; a position random walk [m/sqrt(s)]"));
        assert!(refused("[1, 2]").starts_with("random_walk: 3 values, or one for all, are expected here, e.g. ["));
        assert!(refused("-1").starts_with("random_walk: -1 is out of range"));
    }
}
