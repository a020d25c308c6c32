//! The registry: the list of blocks, for messages, help, schema and tests.
//!
//! typetag turns a `type` name into a spec. This table also knows every name, its fields and an example. A block
//! registers itself with [`register!`](crate::register) in its own file.

#![cfg(feature = "declare")]

use schemars::Schema;
use serde::de::DeserializeOwned;
use std::sync::LazyLock;

/// The purpose of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Moves the state.
    Process,
    /// A measurement model.
    Sensor,
    /// Turns streams into a stream.
    Stage,
    /// Finds part of the initial belief.
    Initialiser,
    /// Judges measurements.
    Gate,
    /// Weighs measurements.
    Loss,
    /// A source of rows.
    Source,
    /// A disturbance of a source.
    Fault,
    /// A part of a simulated trajectory.
    Segment,
    /// A simulated vehicle.
    Vehicle,
    /// Its controller.
    Control,
    /// The task of a simulated vehicle.
    Task,
    /// A connection to an instrument or to another program, while the filter runs.
    Link,
    /// Estimates in some format, which leave by a link.
    Output,
}

impl Role {
    /// Every role, in a good order for readers.
    pub const ALL: [Self; 14] = [
        Self::Process,
        Self::Sensor,
        Self::Stage,
        Self::Initialiser,
        Self::Gate,
        Self::Loss,
        Self::Source,
        Self::Fault,
        Self::Segment,
        Self::Vehicle,
        Self::Control,
        Self::Task,
        Self::Link,
        Self::Output,
    ];

    /// The word used in messages and in the schema.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::Sensor => "sensor",
            Self::Stage => "stage",
            Self::Initialiser => "initialiser",
            Self::Gate => "gate",
            Self::Loss => "loss",
            Self::Source => "source",
            Self::Fault => "fault",
            Self::Segment => "segment",
            Self::Vehicle => "vehicle",
            Self::Control => "control",
            Self::Task => "task",
            Self::Link => "link",
            Self::Output => "output",
        }
    }
}

/// One registered block.
#[derive(Debug)]
pub struct Registration {
    /// Its role.
    pub role: Role,
    /// Its `type` name.
    pub name: &'static str,
    /// Its fields as JSON Schema; the descriptions are the spec's doc comments.
    pub schema: fn() -> Schema,
    /// The module that registers it.
    pub module: &'static str,
    /// Its fields in TOML, complete enough to build: shown by `fusion blocks NAME` and built by
    /// the conformance tests.
    pub example: &'static str,
}

inventory::collect!(Registration);

impl Registration {
    /// The spec of its example, for its role's trait.
    ///
    /// # Errors
    /// The problem of the example.
    pub fn spec<T: DeserializeOwned>(&self) -> Result<T, String> {
        let table: toml::Table = toml::from_str(self.example).map_err(|e| format!("its example is not TOML: {e}"))?;
        // `{ type: table }`, as typetag reads it.
        let mut tagged = toml::Table::new();
        tagged.insert(self.name.to_owned(), toml::Value::Table(table));
        tagged.try_into().map_err(|e| format!("its example is not its spec: {e}"))
    }
}

/// Registers a block: role, `type` name, spec type, example fields in TOML.
#[macro_export]
macro_rules! register {
    ($role:ident, $name:literal, $spec:ty, $example:literal) => {
        $crate::inventory::submit! {
            $crate::registry::Registration {
                role: $crate::registry::Role::$role,
                name: $name,
                module: ::core::module_path!(),
                schema: || $crate::schemars::schema_for!($spec),
                example: $example,
            }
        }
    };
}

/// All registered blocks, by role and name.
#[must_use]
pub fn all() -> Vec<&'static Registration> {
    sorted().to_vec()
}

/// All registered blocks, sorted once: blocks register before the program begins.
fn sorted() -> &'static [&'static Registration] {
    static SORTED: LazyLock<Vec<&'static Registration>> = LazyLock::new(|| {
        let mut all: Vec<_> = inventory::iter::<Registration>.into_iter().collect();
        all.sort_by_key(|r| (r.role, r.name));
        all
    });
    &SORTED
}

/// The `type` names of a role, sorted.
#[must_use]
pub fn names(role: Role) -> Vec<&'static str> {
    sorted().iter().filter(|r| r.role == role).map(|r| r.name).collect()
}

/// Checks that no name is registered twice in one role, which is a mistake in the linked program.
///
/// # Errors
/// A sentence per such name, with the modules that register it.
pub fn refuse_duplicates() -> Result<(), String> {
    refuse_duplicates_of(sorted())
}

/// The same check for blocks sorted by role and name.
fn refuse_duplicates_of(sorted: &[&Registration]) -> Result<(), String> {
    let twice = sorted.windows(2).filter(|w| (w[0].role, w[0].name) == (w[1].role, w[1].name));
    let sentences: Vec<String> = twice
        .map(|w| {
            let (role, name) = (w[0].role.name(), w[0].name);
            format!("the {role} `{name}` is registered by both `{}` and `{}`", w[0].module, w[1].module)
        })
        .collect();
    if sentences.is_empty() { Ok(()) } else { Err(sentences.join("; ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_registered_twice_is_refused_with_both_modules_unless_the_roles_differ() {
        let block = |role, module| Registration {
            role,
            name: "range",
            schema: || Schema::default(),
            module,
            example: "",
        };
        let (ours, theirs, gate) = (
            block(Role::Sensor, "ours"),
            block(Role::Sensor, "theirs"),
            block(Role::Gate, "ours"),
        );
        assert_eq!(refuse_duplicates_of(&[&ours, &gate]), Ok(()));
        let said = refuse_duplicates_of(&[&ours, &theirs, &gate]).unwrap_err();
        assert_eq!(said, "the sensor `range` is registered by both `ours` and `theirs`");
    }
}
