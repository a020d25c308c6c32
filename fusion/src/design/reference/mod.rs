//! `[reference]`: the reference data that a run is scored against.

mod sigma;
mod source;

pub use sigma::{SigmaOf, SigmaSpec};
pub use source::{DifferentiateSpec, ReferenceChannel, ReferencePart, ReferenceSources};

use super::Design;
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::source::have_rows_in_common;

use crate::score::trajectory::{Alignment, Pairs};
use fusion_models::fault::Windows;
use fusion_models::units::{Duration, Positive, Quantity, Vec3Of, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::{Deserializer, Error};

/// The reference data that a run is scored against; never fused.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSpec {
    /// The source with a position and, where it has them, a velocity and an attitude; or several sources, a table
    /// each: `[reference.source.NAME]`.
    pub source: ReferenceSources,
    /// Errors and innovations count from this time on.
    #[serde(default)]
    pub from: Option<Duration>,
    /// NEES counts from this time on, if it is later: after the start has settled.
    #[serde(default)]
    pub nees_from: Option<Duration>,
    /// Times that are scored separately: periods with more errors than the filter models.
    #[serde(default)]
    pub episodes: Option<Windows>,
    /// The errors that a run stays within once it has converged. The results show which runs converged, and how soon.
    #[serde(default, deserialize_with = "ConvergedSpec::with_a_limit")]
    pub converged: Option<ConvergedSpec>,
    /// How the trajectory as a whole is compared: absolute and relative errors (ATE, RPE).
    #[serde(default)]
    pub trajectory: Option<TrajectorySpec>,
    /// Takes the mean rotation between the two bodies, since the filter was aligned, out of the attitude errors.
    #[serde(default)]
    pub remove_mean_mounting: bool,
    /// Of one source: which of its channels count; all without it.
    pub channels: Option<Vec<ReferenceChannel>>,
    /// Of one source: the reference's point in body axes, from the body origin: position and velocity of the
    /// estimate are moved there.
    pub lever_arm: Option<Vec3Of<dim::Length>>,
    /// For one source: height of the water's surface above the ellipsoid, if it has a `depth`.
    pub surface: Option<Quantity<dim::Length>>,
    /// For one source: 1σ of the reference's own errors, which NEES and the share inside 3σ add to that of the
    /// filter; exact without it.
    pub sigma: Option<SigmaSpec>,
    /// Of one source: derives a missing reference velocity from its positions.
    pub velocity_from_position: Option<DifferentiateSpec>,
}

/// The differences of the reference of `other` from that of `first`, as they are written: `lever_arm = [1, 0, 0]
/// instead of [0, 0, 0]`. Errors against different references are not comparable.
#[must_use]
pub fn differences(first: &Design, other: &Design) -> Vec<String> {
    let keys = |design: &Design| -> Vec<(String, String)> {
        let Some(reference) = &design.reference else { return Vec::new() };
        let own = reference.node.entries().iter().map(|e| (e.key.clone(), e.node.inline()));
        let of_source = reference.block.sources().into_iter().filter_map(|(name, _)| {
            let path = design.sources.iter().find(|s| s.name == name)?.node.get("path")?;
            Some((format!("path of `{name}`"), path.inline()))
        });
        own.chain(of_source).collect()
    };
    let (first, other) = (keys(first), keys(other));
    let in_first = |key: &str| first.iter().find(|(k, _)| k == key).map(|(_, value)| value);
    let changed = other.iter().filter_map(|(key, value)| match in_first(key) {
        Some(before) if before == value => None,
        before => Some(format!("{key} = {value} instead of {}", before.map_or("none", String::as_str))),
    });
    let gone = first.iter().filter(|(key, _)| other.iter().all(|(k, _)| k != key));
    changed
        .chain(gone.map(|(key, value)| format!("no {key} instead of {value}")))
        .collect()
}

/// The source of a sensor whose positions the reference reads too, if there is one, and whether some of the rows are the same.
/// Other rows of the same instrument can judge the filter, except for an error that lasts over several rows and is in
/// both. The same rows cannot judge it.
#[must_use]
pub fn of_a_sensor(design: &Design) -> Option<(&str, bool)> {
    let node = |name: &str| design.sources.iter().find(|s| s.name == name).map(|s| &s.node);
    let columns = |name: &str| {
        let node = node(name)?;
        let channels = ["channels.position", "channels.horizontal_position"];
        let position = channels.iter().find_map(|channel| node.at(channel))?;
        let first = ["latitude", "north", "ecef", "utm"].iter().find_map(|key| position.get(key))?;
        Some((node.get("path")?.inline(), first.inline()))
    };
    let reference = design.reference.as_ref()?;
    let judges: Vec<_> = reference.block.source.names().collect();
    let alike = |used: &str, judge: &str| columns(used).is_some_and(|own| columns(judge) == Some(own));
    let same_rows = |used: &str, judge: &str| node(used).zip(node(judge)).is_some_and(|(a, b)| have_rows_in_common(a, b));
    let used = design.sensors.iter().map(|sensor| sensor.block.common.source.as_str());
    let judged = used.flat_map(|used| judges.iter().map(move |judge| (used, *judge)));
    let judged = judged.filter(|(used, judge)| alike(used, judge));
    judged
        .map(|(used, judge)| (used, same_rows(used, judge)))
        .max_by_key(|(_, is_same)| *is_same)
}

impl ReferenceSpec {
    /// Reads the table, and checks the relations between its fields.
    pub(super) fn read(node: &Node, d: &mut Diagnostics) -> Option<Self> {
        let spec: Self = node.read(d)?;
        if spec.source.is_one() {
            return Some(spec);
        }
        let own = ["channels", "lever_arm", "surface", "sigma", "velocity_from_position"];
        for key in own.into_iter().filter(|key| node.get(key).is_some()) {
            let message = format!("`{key}` belongs to one of the sources");
            let help = format!(
                "write it in its table, [reference.source.{}]",
                spec.source.names().next().unwrap_or("NAME")
            );
            d.push(Diagnostic::error(message).at(node.place_of(key)).help(help));
        }
        Some(spec)
    }

    /// The sources, each with its name and its declaration.
    #[must_use]
    pub fn sources(&self) -> Vec<(&str, ReferencePart)> {
        match &self.source {
            ReferenceSources::One(name) => {
                let part = ReferencePart {
                    channels: self.channels.clone(),
                    lever_arm: self.lever_arm.unwrap_or_default(),
                    surface: self.surface,
                    sigma: self.sigma.clone().unwrap_or_default(),
                    velocity_from_position: self.velocity_from_position,
                };
                vec![(name, part)]
            }
            ReferenceSources::Each(parts) => parts.iter().map(|(name, part)| (name.as_str(), part.clone())).collect(),
        }
    }

    /// The reference's point in body axes \[m\], if it has a position.
    #[must_use]
    pub fn point(&self) -> [f64; 3] {
        let parts = self.sources();
        let placed = parts.iter().find(|(_, part)| part.may_have_position());
        placed.map_or([0.0; 3], |(_, part)| part.lever_arm.si())
    }

    /// Where the table of a source has a field.
    pub(crate) fn path(&self, source: &str, field: &str) -> String {
        if self.source.is_one() {
            field.to_owned()
        } else {
            format!("source.{source}.{field}")
        }
    }
}

/// How the trajectory as a whole is compared, as the tool evo does.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectorySpec {
    /// The alignment before the absolute error is shown: `none`, `yaw` with the position, or `se3`, any rotation
    /// and the position. `yaw` by default; summary.json has all three.
    #[serde(default)]
    pub align: Alignment,
    /// Distances along the path for the relative errors. By default the two largest powers of ten \[m\] that fit five
    /// times into the path.
    #[serde(default)]
    pub distances: Vec<Positive<dim::Length>>,
    /// Pairs of poses that are compared over them: `consecutive`, or `all`, which overlap.
    #[serde(default)]
    pub pairs: Pairs,
}

/// Limits of the errors of a run that has converged, at least one. Every epoch from the start of the filter on
/// counts, and no mounting is taken out.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConvergedSpec {
    /// From this time on the errors must stay within the limits to the end of the run; without it, at the end.
    pub by: Option<Duration>,
    /// The limit of the length of the position error.
    pub position: Option<Positive<dim::Length>>,
    /// The limit of the length of the velocity error.
    pub velocity: Option<Positive<dim::Speed>>,
    /// The limit of the heading error, the rotation about the vertical between the two attitudes.
    pub heading: Option<Positive<dim::Angle>>,
}

impl ConvergedSpec {
    fn with_a_limit<'de, T: Deserializer<'de>>(deserializer: T) -> Result<Option<Self>, T::Error> {
        let spec = Self::deserialize(deserializer)?;
        if spec.position.is_none() && spec.velocity.is_none() && spec.heading.is_none() {
            return Err(T::Error::custom("needs a limit: `position`, `velocity` or `heading`"));
        }
        Ok(Some(spec))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converged_without_a_limit_would_be_every_run() {
        let read = |converged: &str| toml::from_str::<ReferenceSpec>(&format!("source = 'truth'\n{converged}"));
        let limits = read("converged = { by = '10 s', position = '5 m' }").unwrap().converged.unwrap();
        assert_eq!((limits.by.unwrap().si(), limits.position.unwrap().si()), (10.0, 5.0));
        assert!(read("converged = { by = '10 s' }").unwrap_err().message().contains("needs a limit"));
        assert!(read("converged = { heading = '5 m' }").is_err() && read("").unwrap().converged.is_none());
    }
}
