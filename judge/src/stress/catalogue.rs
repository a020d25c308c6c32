//! The catalogue of faults, as declared.

use super::draw::{Draw, DrawSpec};
use fusion::config::{Diagnostic, Diagnostics, Document, Entry, Node};
use fusion_models::registry::{self, Role};
use fusion_models::units::{Duration, NonNegative, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The table of a design that overrides the catalogue.
pub(crate) const TABLE: &str = "stress";

/// The built-in file.
const BUILT_IN: &str = include_str!("catalogue.toml");

/// What `fusion stress` applies, and how it judges.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CatalogueSpec {
    /// The moment of the faults, in the time of the log. By default the first moment in motion,
    /// `settle` after the filter has started, that is apart from declared faults and leaves the time to recover.
    pub at: Option<Duration>,
    /// A filter that is beyond 3σ for longer than this while its health is good has failed.
    pub recovery: Option<NonNegative<dim::Duration>>,
    /// How long the filter has to converge before a fault.
    pub settle: Option<NonNegative<dim::Duration>>,
    /// How long a case is watched after the end of its faults.
    pub watch: Option<Positive<dim::Duration>>,
    /// How many random pairs there are.
    pub pairs: Option<u32>,
    /// How much later than the first the second fault of a pair begins, at most.
    pub apart: Option<NonNegative<dim::Duration>>,
    /// How `--draw` draws faults and judges cases.
    #[serde(default)]
    pub draw: DrawSpec,
    /// The faults by name: `type` and fields as a source declares them, with `duration` or `rows` for
    /// the window and `size` for quantities in multiples of the channel's scale. `known` names the
    /// streams or channels on which it is known to fail.
    #[serde(default)]
    pub fault: BTreeMap<String, serde_json::Map<String, serde_json::Value>>,
}

/// The fields of an entry that do not belong to its fault.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Placing {
    enabled: Option<bool>,
    each: Each,
    rows: Option<core::num::NonZeroU32>,
    duration: Option<Positive<dim::Duration>>,
    size: BTreeMap<String, f64>,
    input: BTreeMap<String, f64>,
    recovery: Option<NonNegative<dim::Duration>>,
    known: Vec<String>,
}

/// The target of a fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Each {
    /// The whole rows of a stream.
    #[default]
    Stream,
    /// One channel.
    Channel,
}

/// The length of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Extent {
    /// This number of rows.
    Rows(usize),
    /// This number of seconds.
    Seconds(f64),
    /// To the end of the log.
    ForGood,
}

/// A fault of the catalogue.
#[derive(Clone, Debug)]
pub(super) struct Kind {
    pub(super) name: String,
    pub(super) each: Each,
    pub(super) extent: Extent,
    /// Fields in multiples of the scale: `size` for a sensor's channel, `input` for a channel of the process input.
    pub(super) size: BTreeMap<String, f64>,
    pub(super) input: BTreeMap<String, f64>,
    /// Seconds.
    pub(super) recovery: f64,
    /// `type` and the unscaled fields, in TOML.
    pub(super) fields: Vec<(String, String)>,
    /// The streams or channels on which it is declared to fail.
    pub(super) known: Vec<String>,
    /// The node where it is declared.
    pub(super) node: Node,
}

/// The faults to apply, and how.
#[derive(Clone, Debug)]
pub struct Catalogue {
    pub(super) at: Option<f64>,
    pub(super) settle: f64,
    pub(super) watch: f64,
    pub(super) pairs: u32,
    pub(super) apart: f64,
    pub(super) kinds: Vec<Kind>,
    pub(super) draw: Draw,
}

impl Catalogue {
    /// The built-in catalogue.
    #[must_use]
    pub fn built_in() -> Document {
        Document::parse("built-in catalogue", BUILT_IN).0
    }

    /// Reads `file`, with the overrides of the table `[stress]` of `design`.
    ///
    /// # Errors
    /// All mistakes.
    pub fn read(file: Document, design: &Document) -> Result<Self, Diagnostics> {
        let mut d = Diagnostics::new();
        let mut whole = file;
        if let Some(over) = design.root().get(TABLE) {
            whole.lay(over);
        }
        let spec: Option<CatalogueSpec> = whole.root().read(&mut d);
        let entries = whole.root().get("fault").map_or(&[][..], Node::entries);
        let recovery = spec.as_ref().and_then(|s| s.recovery).map_or(30.0, |r| r.si());
        let kinds: Vec<Kind> = entries.iter().filter_map(|entry| kind(entry, recovery, &mut d)).collect();
        let Some(spec) = spec else { return Err(d) };
        let draw = Draw::read(&spec.draw, whole.root().get("draw"), &mut d);
        d.unless_errors(Self {
            at: spec.at.map(|t| t.si()),
            settle: spec.settle.map_or(60.0, |s| s.si()),
            watch: spec.watch.map_or(120.0, |w| w.si()),
            pairs: spec.pairs.unwrap_or(0),
            apart: spec.apart.map_or(0.0, |a| a.si()),
            kinds,
            draw,
        })
    }

    /// The longest fault that ends, plus its recovery \[s\].
    pub(super) fn span(&self) -> f64 {
        let longest = self.kinds.iter().map(|kind| {
            let lasts = if let Extent::Seconds(seconds) = kind.extent { seconds } else { 0.0 };
            lasts + kind.recovery
        });
        longest.fold(0.0, f64::max)
    }

    /// Keeps the faults with these names; no names keep all.
    ///
    /// # Errors
    /// A name matches no fault.
    pub fn only(&mut self, names: &[String]) -> Result<(), Diagnostics> {
        let mut d = Diagnostics::new();
        let known: Vec<&str> = self.kinds.iter().map(|k| k.name.as_str()).collect();
        for name in names.iter().filter(|name| !known.contains(&name.as_str())) {
            let unknown = Diagnostic::error(format!("the catalogue has no fault `{name}`"));
            d.push(unknown.suggest(name, &known, "its faults"));
        }
        d.unless_errors(())?;
        self.kinds.retain(|k| names.is_empty() || names.contains(&k.name));
        Ok(())
    }

    /// Draws faults of these kinds; no names keep all.
    ///
    /// # Errors
    /// A name matches no kind.
    pub fn draw_only(&mut self, names: &[String]) -> Result<(), Diagnostics> {
        self.draw.only(names)
    }

    /// Sets the number of random pairs.
    pub const fn set_pairs(&mut self, pairs: u32) {
        self.pairs = pairs;
    }
}

/// An entry, if it is valid and enabled.
fn kind(entry: &Entry, recovery: f64, d: &mut Diagnostics) -> Option<Kind> {
    let mut own = entry.node.clone();
    let placing = own.split_off(&["enabled", "each", "rows", "duration", "size", "input", "recovery", "known"]);
    let placing: Placing = placing.read(d)?;
    if placing.enabled == Some(false) {
        return None;
    }
    let known = registry::names(Role::Fault);
    let named = own.get("type").and_then(Node::as_str);
    if !named.is_some_and(|name| known.contains(&name)) {
        let place = own.get("type").map_or(entry.node.name_place(), Node::place);
        let unknown = Diagnostic::error(format!("`{}` has no `type` that is a fault", entry.key)).at(place);
        d.push(unknown.suggest(named.unwrap_or_default(), &known, "known types"));
        return None;
    }
    let extent = match (placing.rows, placing.duration) {
        (Some(_), Some(place)) => {
            let twice = format!("a fault lasts for `rows` or for a `duration`, not both: {} s", place.si());
            d.push(Diagnostic::error(twice).at(entry.node.place_of("duration")));
            return None;
        }
        (Some(rows), None) => Extent::Rows(rows.get() as usize),
        (None, Some(duration)) => Extent::Seconds(duration.si()),
        (None, None) => Extent::ForGood,
    };
    let fields = own.entries().iter().map(|e| (e.key.clone(), e.node.inline()));
    Some(Kind {
        name: entry.key.clone(),
        each: placing.each,
        extent,
        size: placing.size,
        input: placing.input,
        recovery: placing.recovery.map_or(recovery, |r| r.si()),
        fields: fields.collect(),
        known: placing.known,
        node: entry.node.clone(),
    })
}
