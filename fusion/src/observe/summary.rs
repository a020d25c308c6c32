//! The result of a run: named sections, each made by one observer.

use super::RunSection;
use core::any::Any;
use core::fmt::Debug;
use erased_serde::Serialize as Value;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use std::sync::Arc;

/// A key of summary.json and its value.
pub type Keyed<'a> = (&'static str, &'a dyn Value);

/// A section of the result of a run.
///
/// ```
/// use fusion::observe::Section;
/// use fusion::run::Summary;
///
/// #[derive(Debug, serde::Serialize)]
/// struct Turns {
///     left: u64,
///     right: u64,
/// }
///
/// impl Section for Turns {
///     const NAME: &'static str = "turns";
/// }
///
/// let summary = Summary::default().with(Turns { left: 3, right: 4 });
/// assert_eq!(summary.get::<Turns>().map(|turns| turns.left), Some(3));
/// assert_eq!(serde_json::to_string(&summary)?, r#"{"turns":{"left":3,"right":4}}"#);
/// # Ok::<(), serde_json::Error>(())
/// ```
pub trait Section: Serialize + Debug + Send + Sync + 'static {
    /// Its name, `snake_case`, which is the key in summary.json. A run stops with an error if two observers make sections
    /// with the same key.
    const NAME: &'static str;
    /// True if several observers may make such a section. The key in summary.json then has the list of them.
    const MAY_REPEAT: bool = false;

    /// Its keys in summary.json, if each part of the section has its own key.
    fn keys(&self) -> Vec<Keyed<'_>>
    where
        Self: Sized,
    {
        vec![(Self::NAME, self)]
    }

    /// The table for readers, in the terminal and in the report. The built-in sections have none: the crate that
    /// presents results knows them.
    fn shown(&self) -> Option<RunSection> {
        None
    }
}

/// One of many parts: the list of them is a section.
pub trait Listed: Serialize + Debug + Send + Sync + 'static {
    /// The name of the list.
    const NAME: &'static str;
}

impl<T: Listed> Section for Vec<T> {
    const NAME: &'static str = T::NAME;
}

/// A [`Section`] of any type.
trait AnySection: Any + Debug + Send + Sync {
    fn keys(&self) -> Vec<Keyed<'_>>;
    fn shown(&self) -> Option<RunSection>;
}

impl<T: Section> AnySection for T {
    fn keys(&self) -> Vec<Keyed<'_>> {
        Section::keys(self)
    }

    fn shown(&self) -> Option<RunSection> {
        Section::shown(self)
    }
}

/// A section, or the name of a section without content: `null` in summary.json.
#[derive(Clone, Debug)]
pub struct Entry {
    name: &'static str,
    may_repeat: bool,
    section: Option<Arc<dyn AnySection>>,
}

impl<T: Section> From<Option<T>> for Entry {
    fn from(section: Option<T>) -> Self {
        Self {
            name: T::NAME,
            may_repeat: T::MAY_REPEAT,
            section: section.map(|section| Arc::new(section) as Arc<dyn AnySection>),
        }
    }
}

impl<T: Section> From<T> for Entry {
    fn from(section: T) -> Self {
        Some(section).into()
    }
}

impl Entry {
    /// Its keys in summary.json.
    fn keys(&self) -> Vec<&'static str> {
        match &self.section {
            Some(section) if !self.may_repeat => section.keys().into_iter().map(|(key, _)| key).collect(),
            _ => vec![self.name],
        }
    }
}

/// The result of a run: its sections, in the order of summary.json. Sections are accessed by their types.
#[derive(Clone, Debug, Default)]
pub struct Summary(Vec<Entry>);

impl Summary {
    /// The section of this type; `None` if the run has none.
    #[must_use]
    pub fn get<T: Section>(&self) -> Option<&T> {
        let sections = self.0.iter().filter_map(|entry| entry.section.as_deref());
        sections.filter_map(|section| (section as &dyn Any).downcast_ref()).next()
    }

    /// The list of these parts; empty if the run has none.
    #[must_use]
    pub fn list<T: Listed>(&self) -> &[T] {
        self.get::<Vec<T>>().map_or(&[], Vec::as_slice)
    }

    /// The same result with this section, which replaces a section of the same name.
    #[must_use]
    pub fn with(mut self, section: impl Into<Entry>) -> Self {
        self.put(section);
        self
    }

    /// Adds a section. It replaces a section of the same name.
    pub fn put(&mut self, section: impl Into<Entry>) {
        let entry = section.into();
        match self.0.iter_mut().find(|known| known.name == entry.name) {
            Some(known) if !entry.may_repeat => *known = entry,
            _ => self.0.push(entry),
        }
    }

    /// A key of `entry` that a section already has.
    pub(crate) fn has_key_of(&self, entry: &Entry) -> Option<&'static str> {
        let known = self.0.iter().filter(|known| !(known.may_repeat && known.name == entry.name));
        let taken: Vec<&str> = known.flat_map(Entry::keys).collect();
        entry.keys().into_iter().find(|key| taken.contains(key))
    }

    /// The tables that sections make for readers.
    pub fn shown(&self) -> impl Iterator<Item = RunSection> {
        self.0.iter().filter_map(|entry| entry.section.as_ref()?.shown())
    }

    /// The values of all sections with this name.
    fn values(&self, name: &str) -> Vec<&dyn Value> {
        let named = self.0.iter().filter(|entry| entry.name == name);
        let keys = named.flat_map(|entry| entry.section.iter().flat_map(|section| section.keys()));
        keys.map(|(_, value)| value).collect()
    }
}

impl Serialize for Summary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (k, entry) in self.0.iter().enumerate() {
            if entry.may_repeat {
                let is_first = self.0[..k].iter().all(|earlier| earlier.name != entry.name);
                if is_first {
                    map.serialize_entry(entry.name, &self.values(entry.name))?;
                }
                continue;
            }
            match &entry.section {
                Some(section) => section
                    .keys()
                    .into_iter()
                    .try_for_each(|(key, value)| map.serialize_entry(key, value))?,
                None => map.serialize_entry(entry.name, &())?,
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Serialize)]
    struct Count(u64);

    impl Section for Count {
        const NAME: &'static str = "count";
    }

    #[derive(Debug, Serialize)]
    struct Pair {
        a: u64,
        b: Option<f64>,
    }

    impl Section for Pair {
        const NAME: &'static str = "pair";

        fn keys(&self) -> Vec<Keyed<'_>> {
            vec![("first", &self.a), ("second", &self.b)]
        }
    }

    #[derive(Debug, Serialize)]
    struct Part(u64);

    impl Listed for Part {
        const NAME: &'static str = "parts";
    }

    fn table(name: &str) -> RunSection {
        RunSection {
            name: name.to_owned(),
            ..RunSection::default()
        }
    }

    #[test]
    fn sections_are_found_by_type_and_written_in_order_by_key() {
        let summary = Summary::default()
            .with(None::<Count>)
            .with(table("one"))
            .with(Pair { a: 1, b: None })
            .with(table("two"))
            .with(vec![Part(3), Part(4)]);
        assert!(summary.get::<Count>().is_none());
        assert_eq!(summary.get::<Pair>().unwrap().a, 1);
        assert_eq!(summary.list::<Part>().len(), 2);
        let names: Vec<String> = summary.shown().map(|section| section.name).collect();
        assert_eq!(names, ["one", "two"]);
        let one = serde_json::to_string(&table("one")).unwrap();
        let two = serde_json::to_string(&table("two")).unwrap();
        let written = serde_json::to_string(&summary).unwrap();
        let rest = format!(r#""sections":[{one},{two}],"first":1,"second":null,"parts":[3,4]}}"#);
        assert_eq!(written, format!(r#"{{"count":null,{rest}"#));
        // A key is taken, also by a section without content, but tables may repeat.
        let key_of = |entry: Entry| summary.has_key_of(&entry);
        assert_eq!(key_of(None::<Count>.into()), Some("count"));
        assert_eq!(key_of(Pair { a: 0, b: None }.into()), Some("first"));
        assert_eq!(key_of(table("three").into()), None);
        // A later section of the same name takes the place of the earlier one.
        let counted = serde_json::to_string(&summary.with(Count(7))).unwrap();
        assert_eq!(counted, format!(r#"{{"count":7,{rest}"#));
    }
}
