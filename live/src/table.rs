//! The tables `[link.NAME]` and `[output.NAME]` of a design.

use crate::link::LinkSpec;
use crate::output::OutputSpec;
use fusion::config::{Diagnostic, Diagnostics, Document, Node};
use fusion::design::{FurtherTable, LinkCommon, OutputCommon};
use fusion::inventory;
use fusion::models::registry::{self, Role};
use serde::de::DeserializeOwned;

/// A declared link.
#[derive(Debug)]
pub(crate) struct LinkDesign {
    pub(crate) name: String,
    pub(crate) common: LinkCommon,
    pub(crate) spec: Box<dyn LinkSpec>,
}

/// A declared output.
#[derive(Debug)]
pub(crate) struct OutputDesign {
    pub(crate) name: String,
    pub(crate) common: OutputCommon,
    pub(crate) spec: Box<dyn OutputSpec>,
}

/// The links and outputs of a design.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    pub(crate) links: Vec<LinkDesign>,
    pub(crate) outputs: Vec<OutputDesign>,
}

const LINK: &str = "link";
const OUTPUT: &str = "output";

inventory::submit! {
    FurtherTable {
        name: LINK,
        schema: None,
        check: |document, d| {
            Tables::read(document, d);
        },
    }
}

impl Tables {
    /// Reads both tables, and reports all mistakes to `d`.
    pub(crate) fn read(document: &Document, d: &mut Diagnostics) -> Self {
        let root = document.root();
        let mut tables = Self::default();
        let sources: Vec<&str> = names(root, "source");
        let mut taken: Vec<&str> = Vec::new();
        for (name, node) in named(root, LINK) {
            let keys = ["sources", "clock", "drift", "most_waiting"];
            let Some((common, spec)) = block::<LinkCommon, dyn LinkSpec>(node, &keys, (LINK, Role::Link), d) else {
                continue;
            };
            for source in &common.sources {
                let place = || node.place_of("sources");
                match sources.iter().find(|known| *known == source) {
                    None => {
                        let unknown = Diagnostic::error(format!("no source is called `{source}`")).at(place());
                        d.push(unknown.suggest(source, &sources, "there are"));
                    }
                    Some(known) if taken.contains(known) => {
                        let twice = Diagnostic::error(format!("two links bring the bytes of the source `{source}`")).at(place());
                        d.push(twice.help("declare one source for each link"));
                    }
                    Some(known) => taken.push(known),
                }
            }
            tables.links.push(LinkDesign {
                name: name.to_owned(),
                common,
                spec,
            });
        }
        let links = names(root, LINK);
        for (name, node) in named(root, OUTPUT) {
            let read = block::<OutputCommon, dyn OutputSpec>(node, &["rate", "watchdog"], (OUTPUT, Role::Output), d);
            let Some((common, spec)) = read else { continue };
            if let Some(link) = spec.link().filter(|link| !links.contains(link)) {
                let unknown = Diagnostic::error(format!("no link is called `{link}`")).at(node.place_of("link"));
                d.push(unknown.suggest(link, &links, "there are"));
            }
            tables.outputs.push(OutputDesign {
                name: name.to_owned(),
                common,
                spec,
            });
        }
        tables
    }
}

fn named<'a>(root: &'a Node, table: &str) -> impl Iterator<Item = (&'a str, &'a Node)> {
    let entries = root.get(table).map_or(&[][..], Node::entries);
    entries.iter().map(|entry| (entry.key.as_str(), &entry.node))
}

fn names<'a>(root: &'a Node, table: &str) -> Vec<&'a str> {
    named(root, table).map(|(name, _)| name).collect()
}

/// The shared fields of a block and the block itself.
fn block<C: DeserializeOwned, T: ?Sized>(
    node: &Node,
    keys: &[&str],
    (role, registered): (&str, Role),
    d: &mut Diagnostics,
) -> Option<(C, Box<T>)>
where
    Box<T>: DeserializeOwned,
{
    if let Some(absent) = absent(node, registered) {
        d.push(absent);
        return None;
    }
    let mut own = node.clone();
    let common: Option<C> = own.split_off(keys).read(d);
    let spec = own.read_block::<T>(role, &registry::names(registered), d)?;
    Some((common?, spec))
}

/// Types that are features of the command, for messages: a program without the feature knows only their names.
const FEATURES: [(Role, &str); 5] = [
    (Role::Link, "serial"),
    (Role::Link, "ros2"),
    (Role::Output, "ros2"),
    (Role::Output, "foxglove"),
    (Role::Output, "mavlink"),
];

/// That this program is built without the type of a block.
fn absent(node: &Node, role: Role) -> Option<Diagnostic> {
    let named = node.get("type")?;
    let name = named.as_str()?;
    let is_absent = FEATURES.contains(&(role, name)) && !registry::names(role).contains(&name);
    is_absent.then(|| {
        let message = format!("this program is built without the {} `{name}`", role.name());
        let help = format!("build it with the feature: `cargo build --release --features {name}`");
        Diagnostic::error(message).at(named.place()).help(help)
    })
}
