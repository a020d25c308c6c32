//! What `[simulation]` says.

use super::imu_error::ImuErrorSpec;
use super::noise::SensorErrorSpec;
use super::segment::{Junction, SegmentSpec};
use super::trajectory::Trajectory;
use crate::block::BuildError;
use crate::registry::{self, Role};
use crate::units::{Positive, Quantity, Vec3Of, dim};
use nalgebra::Vector3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A simulated run: a trajectory, an inertial measurement unit, and how wrong each sensor is.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulationSpec {
    /// Seed of all randomness; another seed is another run.
    #[serde(default)]
    pub seed: u64,
    /// The inertial measurement unit; needed by a process that is driven by one.
    pub imu: Option<ImuErrorSpec>,
    /// Rows per second of the `reference` stream: the truth.
    #[serde(default = "reference_rate")]
    pub reference_rate: Positive<dim::Frequency>,
    /// Whether estimated parameters are truly off their initial values, by a draw from their
    /// declared sigma, and move as their declared dynamics say.
    #[serde(default)]
    pub draw_parameters: bool,
    /// Where the trajectory starts.
    #[serde(default)]
    pub start: StartSpec,
    /// The segments of the trajectory, in order.
    #[schemars(schema_with = "segments_schema")]
    pub trajectory: Vec<Box<dyn SegmentSpec>>,
    /// How each sensor is simulated, by its name; a sensor without an entry is not simulated.
    #[serde(default)]
    pub sensor: BTreeMap<String, SensorErrorSpec>,
}

/// The start of the trajectory: at rest and level.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartSpec {
    /// Position relative to the origin of the run: north, east, down.
    #[serde(default)]
    position: Vec3Of<dim::Length>,
    /// Heading.
    #[serde(default)]
    heading: Quantity<dim::Angle>,
}

impl SimulationSpec {
    /// The trajectory in local north-east-down.
    ///
    /// # Errors
    /// [`BuildError`] whose field is `trajectory.i.…`.
    pub fn trajectory(&self) -> Result<Trajectory, BuildError> {
        let position = Vector3::from(self.start.position.si());
        Trajectory::new(
            Junction {
                position,
                heading: self.start.heading.si(),
                speed: 0.0,
            },
            &self.trajectory,
        )
    }
}

/// Ten per second.
fn reference_rate() -> Positive<dim::Frequency> {
    const TEN_HERTZ: &str = "10 Hz";
    #[expect(clippy::expect_used, reason = "a constant, and a test reads it")]
    Positive::from_text(TEN_HERTZ).expect("a frequency")
}

/// An array of any of the registered segments, each with its `type`.
fn segments_schema(_: &mut SchemaGenerator) -> Schema {
    let segment = |r: &&registry::Registration| {
        let mut schema = (r.schema)();
        schema.remove("$schema");
        if let Some(properties) = schema
            .ensure_object()
            .entry("properties")
            .or_insert_with(|| json_schema!({}).into())
            .as_object_mut()
        {
            properties.insert("type".to_owned(), json_schema!({ "const": r.name }).into());
        }
        schema
    };
    let any: Vec<Schema> = registry::all().iter().filter(|r| r.role == Role::Segment).map(segment).collect();
    json_schema!({ "type": "array", "minItems": 1, "items": { "anyOf": any } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_read() {
        let spec: SimulationSpec = toml::from_str("trajectory = [{ rest = { duration = '1 s' } }]").unwrap();
        assert_eq!(spec.reference_rate.si(), 10.0);
        assert!(spec.imu.is_none() && !spec.draw_parameters && spec.sensor.is_empty());
        assert_eq!(spec.trajectory().unwrap().duration(), 1.0);
    }

    #[test]
    fn the_start_is_relative_to_the_origin_of_the_run() {
        let text = "start = { position = [1, 2, 3], heading = '90 deg' }\ntrajectory = [{ rest = { duration = 1 } }]";
        let start = toml::from_str::<SimulationSpec>(text).unwrap().trajectory().unwrap().at(0.0);
        assert_eq!(start.position, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(start.rpy.z, core::f64::consts::FRAC_PI_2);
    }

    #[test]
    fn the_schema_lists_every_segment_with_its_type() {
        let schema = serde_json::to_value(schemars::schema_for!(SimulationSpec)).unwrap();
        let segments = schema["properties"]["trajectory"]["items"]["anyOf"].as_array().unwrap();
        let names: Vec<_> = segments
            .iter()
            .map(|s| s["properties"]["type"]["const"].as_str().unwrap())
            .collect();
        assert_eq!(names, registry::names(Role::Segment));
        assert!(names.contains(&"turn"));
    }
}
