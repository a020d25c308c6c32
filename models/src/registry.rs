//! The registry: which blocks there are, for messages, help, schema and tests.
//!
//! typetag turns a `type` name into a spec; this table beside it knows every name, its fields
//! and an example. A block registers itself with [`register!`](crate::register) in its own file.

use schemars::Schema;

/// What a block is for.
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
    /// Something that goes wrong with a source.
    Fault,
    /// A piece of a simulated trajectory.
    Segment,
}

impl Role {
    /// Every role, in the order a reader wants them.
    pub const ALL: [Self; 9] = [
        Self::Process,
        Self::Sensor,
        Self::Stage,
        Self::Initialiser,
        Self::Gate,
        Self::Loss,
        Self::Source,
        Self::Fault,
        Self::Segment,
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
    /// Its fields in TOML, complete enough to build: shown by `fusion blocks NAME` and built by
    /// the conformance tests.
    pub example: &'static str,
}

inventory::collect!(Registration);

/// Registers a block: role, `type` name, spec type, example fields in TOML.
#[macro_export]
macro_rules! register {
    ($role:ident, $name:literal, $spec:ty, $example:literal) => {
        $crate::inventory::submit! {
            $crate::registry::Registration {
                role: $crate::registry::Role::$role,
                name: $name,
                schema: || $crate::schemars::schema_for!($spec),
                example: $example,
            }
        }
    };
}

/// All registered blocks, by role and name.
#[must_use]
pub fn all() -> Vec<&'static Registration> {
    let mut all: Vec<_> = inventory::iter::<Registration>.into_iter().collect();
    all.sort_by_key(|r| (r.role, r.name));
    all
}

/// The `type` names of a role, sorted.
#[must_use]
pub fn names(role: Role) -> Vec<&'static str> {
    all().into_iter().filter(|r| r.role == role).map(|r| r.name).collect()
}

/// Names registered twice in one role: an error of whoever links the program.
#[must_use]
pub fn duplicates() -> Vec<(Role, &'static str)> {
    let all = all();
    all.windows(2)
        .filter(|w| (w[0].role, w[0].name) == (w[1].role, w[1].name))
        .map(|w| (w[0].role, w[0].name))
        .collect()
}
