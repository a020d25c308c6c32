//! From a node to a spec, collecting mistakes.
//!
//! serde stops at the first mistake. So the wrong node is reported and hidden, and the reading is repeated.
//! It ends when it succeeds, or when it fails only because a hidden node is missing. Trait objects turn all
//! errors into text; therefore the wrong node is kept next to the error, not in it.

use std::cell::RefCell;
use std::collections::HashSet;

use fusion_models::block::NestedBlock;
use serde::de::DeserializeOwned;

use super::diagnostic::{Diagnostic, Diagnostics, Place, did_you_mean};
use super::document::{Node, Value};
use super::fault::Fault;
use super::reader::Reader;

/// The key that names the type of a block.
pub(super) const TYPE: &str = "type";
/// Mistakes reported of one node at most.
const MOST: usize = 50;

impl Node {
    /// Reads the node as a `T`, and reports as many independent mistakes as possible.
    ///
    /// A table read as a [`NestedBlock`] trait object (externally tagged typetag) or as an enum has the name of
    /// its variant in the field `type`, at any depth. The name alone, `"nis"`, is short for
    /// `{ type = "nis" }`.
    pub fn read<T: DeserializeOwned>(&self, diagnostics: &mut Diagnostics) -> Option<T> {
        let mut hidden = HashSet::new();
        for _ in 0..MOST {
            let attempt = Attempt {
                hidden: &hidden,
                blame: RefCell::default(),
            };
            let fault = match T::deserialize(Reader::new(self, &attempt)) {
                Ok(value) => return hidden.is_empty().then_some(value),
                Err(fault) => fault,
            };
            let blame = attempt.blame.into_inner().unwrap_or(Blame {
                node: self,
                place: &self.place,
                moved: &[],
                fault,
            });
            if !blame.is_consequence(&hidden) {
                diagnostics.push(blame.fault.diagnose(blame.place, blame.moved));
            }
            if std::ptr::eq(blame.node, self) || !hidden.insert(std::ptr::from_ref(blame.node)) {
                return None;
            }
        }
        None
    }

    /// Reads the node as a block: a table whose `type` is one of the `known` types of this `role`. A role
    /// is for example `gate` or `process model`.
    pub fn read_block<T: ?Sized>(&self, role: &str, known: &[&str], diagnostics: &mut Diagnostics) -> Option<Box<T>>
    where
        Box<T>: DeserializeOwned,
    {
        diagnostics.keep(self.check_type(role, known))?;
        self.read::<NestedBlock<T>>(diagnostics).map(|block| block.0)
    }

    /// Reports the `required` fields that are missing in this unreadable block: serde stops at the first missing
    /// field. Fields already reported after the first `before` diagnostics are not repeated.
    pub fn miss(&self, required: &[&str], before: usize, diagnostics: &mut Diagnostics) {
        let has = |field: &str| self.entries().iter().any(|entry| did_you_mean(&entry.key, &[field]).is_some());
        for field in required.iter().filter(|field| !has(field)) {
            let missing = Diagnostic::error(format!("missing field `{field}`")).at(&self.name);
            let missing = missing.label(format!("needs `{field}`"));
            if !diagnostics.iter().skip(before).any(|told| *told == missing) {
                diagnostics.push(missing);
            }
        }
    }

    fn check_type(&self, role: &str, known: &[&str]) -> Result<(), Diagnostic> {
        let wrong = |message: String, place| Err(Diagnostic::error(message).at(place).suggest("", known, "known types"));
        let named = match (&self.value, self.get(TYPE)) {
            (Value::String(_), _) => self,
            (Value::Table { .. }, Some(named)) => named,
            (Value::Table { .. }, None) => {
                return wrong(format!("this {role} has no `type`"), &self.name);
            }
            _ => {
                return wrong(format!("this {role} is not a table with a `type`"), &self.place);
            }
        };
        match named.as_str() {
            Some(name) if known.contains(&name) => Ok(()),
            Some(name) => {
                let unknown = Diagnostic::error(format!("unknown {role} `{name}`"));
                Err(unknown.at(&named.place).suggest(name, known, "known types"))
            }
            None => wrong("a `type` is a name in quotes".to_owned(), &named.place),
        }
    }

    pub(super) fn moved(&self) -> &[String] {
        match &self.value {
            Value::Table { moved, .. } => moved,
            _ => &[],
        }
    }

    /// Returns true if `is` holds for this node or for a node below it.
    pub fn any(&self, is: &dyn Fn(&Self) -> bool) -> bool {
        is(self) || self.children().any(|child| child.any(is))
    }

    fn children(&self) -> Box<dyn Iterator<Item = &Self> + '_> {
        match &self.value {
            Value::Array(nodes) => Box::new(nodes.iter()),
            _ => Box::new(self.entries().iter().map(|entry| &entry.node)),
        }
    }
}

/// Nodes that were at fault before, by address: the tree does not change while it is read.
type Hidden = HashSet<*const Node>;

/// One run over the node.
pub(super) struct Attempt<'a> {
    hidden: &'a Hidden,
    blame: RefCell<Option<Blame<'a>>>,
}

/// A mistake, the place where it is shown, and the node to hide for it.
pub(super) struct Blame<'a> {
    pub(super) node: &'a Node,
    pub(super) place: &'a Place,
    /// Fields to suggest although they are read elsewhere.
    pub(super) moved: &'a [String],
    pub(super) fault: Fault,
}

impl Blame<'_> {
    /// Returns true if this is wrong only because a node has been hidden.
    fn is_consequence(&self, hidden: &Hidden) -> bool {
        let is_hidden = |node: &Node| hidden.contains(&std::ptr::from_ref(node));
        match &self.fault {
            Fault::MissingField(field) => self
                .node
                .entries()
                .iter()
                .filter(|entry| is_hidden(&entry.node))
                .any(|entry| did_you_mean(&entry.key, &[field]).is_some()),
            Fault::Said(_) | Fault::Unexpected { .. } => self.node.children().any(|child| child.any(&is_hidden)),
            _ => false,
        }
    }
}

impl<'a> Attempt<'a> {
    /// Whether the node was at fault before.
    pub(super) fn hides(&self, node: &Node) -> bool {
        self.hidden.contains(&std::ptr::from_ref(node))
    }

    /// Records the place of the mistake, unless a deeper one is recorded already.
    pub(super) fn blame(&self, blame: Blame<'a>) -> Fault {
        let fault = blame.fault.clone();
        self.blame.borrow_mut().get_or_insert(blame);
        fault
    }
}
