//! The selection from a file of designs: variants, a backend, single values.

use crate::config::{Diagnostic, Diagnostics, Document};
use crate::design::{Design, FilterSpec};
use crate::load::build;
use std::path::Path;

/// The name of a design without a variant.
pub const BASE: &str = "base";

/// The changes laid over the file of a design, in this order.
///
/// ```
/// use fusion::Selection;
///
/// let selection = Selection {
///     backend: Some("iekf".to_owned()),
///     set: vec!["sensor.position.lever_arm=[0, 0, 0]".to_owned()],
///     ..Selection::default()
/// };
/// let design = selection.load("../examples/embed.toml")?;
/// assert_eq!(design.filter.backend_name(), "body / iterated / joseph");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Names of tables `[variant.NAME]`, several in the order given, or as `A+B`; `base` selects no variant.
    pub variants: Vec<String>,
    /// A backend in place of the table `[filter]`: `ekf`, `error_state`, `iekf`, `invariant`, `ukf`, or any chart, update
    /// and form, as in `left_invariant+iterated`.
    pub backend: Option<String>,
    /// Single values: `sensor.gnss.noise.sigma=3 m`.
    pub set: Vec<String>,
}

impl Selection {
    /// The design of a file with the parts that it includes.
    ///
    /// # Errors
    /// Every mistake, each with its place.
    pub fn load(&self, path: impl AsRef<Path>) -> Result<Design, Diagnostics> {
        self.design(&Document::load(path.as_ref())?)
    }

    /// The design of a text, which diagnostics call `design.toml`; the paths of what it includes start at `folder`.
    ///
    /// # Errors
    /// Every mistake, each with its place.
    pub fn read(&self, folder: impl AsRef<Path>, text: &str) -> Result<Design, Diagnostics> {
        self.design(&Document::read_in(folder.as_ref(), text)?)
    }

    fn design(&self, file: &Document) -> Result<Design, Diagnostics> {
        let (document, mut d) = self.over(file);
        match build(document) {
            Ok(design) => d.unless_errors(design),
            Err(more) => {
                d.extend(more.iter().cloned());
                Err(d)
            }
        }
    }

    /// The variants, one by one.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        let names = self.variants.iter().flat_map(|names| names.split('+'));
        names.filter(|name| *name != BASE).collect()
    }

    /// The document with this selection laid over it, and the mistakes of the selection.
    #[must_use]
    pub fn over(&self, file: &Document) -> (Document, Diagnostics) {
        let (mut document, mut d) = (file.clone(), Diagnostics::new());
        for name in self.names() {
            let laid = check_variant(&document, name).and_then(|()| document.overlay(&format!("variant.{name}")));
            d.keep(laid);
        }
        let backend = self.backend.as_deref().and_then(|words| d.keep(FilterSpec::table_of(words)));
        for assignment in backend.iter().chain(&self.set) {
            d.keep(document.set(assignment));
        }
        (document, d)
    }
}

fn check_variant(document: &Document, name: &str) -> Result<(), Diagnostic> {
    let table = document.root().get("variant");
    let known: Vec<&str> = table.map_or(&[][..], |t| t.entries()).iter().map(|e| e.key.as_str()).collect();
    if known.contains(&name) {
        return Ok(());
    }
    let file = document.name();
    let unknown = Diagnostic::error(format!("`{file}` has no variant `{name}`"));
    Err(if name.contains(',') {
        unknown.help(format!(
            "here there is one design: `--variant {}` lays these over each other; `fusion compare` runs each of them",
            name.replace(',', "+")
        ))
    } else if known.is_empty() {
        unknown.help(format!(
            "a variant is a table [variant.{name}] with what differs; this file has none"
        ))
    } else {
        unknown.suggest(name, &known, "its variants")
    })
}
