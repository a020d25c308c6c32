//! The origin of a result: everything that is necessary to repeat it.

use crate::checkpoint::fingerprint_of_run;
use crate::design::Design;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The inputs of a run, or of each run of a comparison.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    /// The file of the design, as it was named.
    pub design: String,
    /// The variants that were laid over it, in order.
    pub variants: Vec<String>,
    /// The values that were set on the command line, in order: `path=value`.
    pub set: Vec<String>,
    /// The seed of simulated data and random faults; `None` if nothing is drawn.
    pub seed: Option<u64>,
    /// A number made of all that the design says with its variants and set values, comments and places left out, as 16
    /// hexadecimal digits: FNV-1a of 64 bits. The same number means the same design.
    pub hash: String,
    /// The version of the program.
    pub version: String,
}

impl Provenance {
    /// That of a run of `design`; `seed` in place of the design's own.
    #[must_use]
    pub fn of(design: &Design, seed: Option<u64>) -> Self {
        let document = &design.document;
        let changes = document.changes();
        let is_drawn = design.simulation.is_some() || design.sources.iter().any(|source| !source.block.faults.is_empty());
        let variants = changes.overlays.iter().map(|path| path.strip_prefix("variant.").unwrap_or(path));
        Self {
            design: document.name().to_owned(),
            variants: variants.map(str::to_owned).collect(),
            set: changes.edits.clone(),
            seed: is_drawn.then_some(seed.unwrap_or(design.run.seed)),
            hash: format!("{:016x}", fingerprint_of_run(document, "")),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// The entries that are the same in several runs; the others are left empty.
    #[must_use]
    pub fn common<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = all.into_iter();
        let first = all.next().cloned().unwrap_or_default();
        all.fold(first, |mut common, other| {
            fn keep<T: Default + PartialEq>(value: &mut T, other: &T) {
                if value != other {
                    *value = T::default();
                }
            }
            keep(&mut common.design, &other.design);
            keep(&mut common.variants, &other.variants);
            keep(&mut common.set, &other.set);
            keep(&mut common.seed, &other.seed);
            keep(&mut common.hash, &other.hash);
            common
        })
    }

    /// One line, without empty entries.
    #[must_use]
    pub fn line(&self) -> String {
        let given = |is_given: bool, text: String| Some(text).filter(|_| is_given);
        let parts = [
            given(!self.design.is_empty(), self.design.clone()),
            given(!self.variants.is_empty(), format!("variant {}", self.variants.join("+"))),
            given(!self.set.is_empty(), format!("set {}", self.set.join(", "))),
            self.seed.map(|seed| format!("seed {seed}")),
            given(!self.hash.is_empty(), format!("design {}", self.hash)),
            given(!self.version.is_empty(), format!("fusion {}", self.version)),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(" · ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Document;

    fn of(edit: &str, variant: Option<&str>, seed: Option<u64>) -> Provenance {
        let text = "run.seed = 3\n[process]\ntype = 'hold'\nsource = 'x'\n[variant.late]\nrun.start = '1 s'\n";
        let (mut document, _) = Document::parse("hold.toml", text);
        if let Some(variant) = variant {
            document.overlay(&format!("variant.{variant}")).unwrap();
        }
        if !edit.is_empty() {
            document.set(edit).unwrap();
        }
        Provenance {
            seed,
            design: document.name().to_owned(),
            variants: document.changes().overlays.clone(),
            set: document.changes().edits.clone(),
            hash: format!("{:016x}", fingerprint_of_run(&document, "")),
            version: "9".to_owned(),
        }
    }

    #[test]
    fn the_same_hash_is_the_same_design_however_it_came_about() {
        let (plain, variant, set) = (of("", None, None), of("", Some("late"), None), of("run.start=1 s", None, None));
        assert_eq!(variant.hash, set.hash);
        assert_ne!(plain.hash, set.hash);
        assert_eq!((variant.variants.len(), set.set.as_slice()), (1, &["run.start=1 s".to_owned()][..]));
        assert_eq!(
            set.line(),
            format!("hold.toml · set run.start=1 s · design {} · fusion 9", set.hash)
        );
    }

    #[test]
    fn of_several_runs_what_they_share_is_left() {
        let common = Provenance::common(&[of("", None, Some(4)), of("", Some("late"), Some(4))]);
        assert_eq!(common.line(), "hold.toml · seed 4 · fusion 9");
        assert_eq!(Provenance::common(&[]), Provenance::default());
    }
}
