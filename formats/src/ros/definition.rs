//! Message definitions of ROS 1 and ROS 2: the text of a `.msg` file, with the definitions that it needs after it.
//!
//! ```text
//! std_msgs/Header header          a nested type, by its full or short name
//! float64[9] position_covariance  a fixed array
//! string[<=4] names               a bounded array; `float64[]` has no bound
//! uint8 FIX = 0                   a constant, which is not in a message
//! int32 count 5                   a field with its default, which is not in a message either
//! ===========                     the end of this definition; the next one begins with its name
//! MSG: std_msgs/Header
//! ```
//!
//! Not read   wide strings, whose encoding differs between the implementations of ROS 2

use std::collections::{BTreeSet, HashMap};

/// The definitions of a message type and of the types that it needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Definitions {
    types: HashMap<String, Vec<Field>>,
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) array: Array,
}

/// The type of a field, or of the elements of an array.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Number(Number),
    Time,
    Duration,
    Text,
    /// Another definition, by its name without `msg`: `std_msgs/Header`.
    Message(String),
}

/// A number, as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// How many values a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Array {
    One,
    Fixed(usize),
    /// The message gives their number.
    Any,
}

impl Number {
    /// Its bytes.
    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// The name of a message type without `msg`, so that the names of ROS 1 and ROS 2 are equal.
pub(crate) fn short_name(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

impl Definitions {
    /// The definitions in a text, which begins with that of `name`.
    ///
    /// # Errors
    /// The text has a line that cannot be read, or a type that is not defined.
    pub(crate) fn parse(name: &str, text: &str) -> Result<Self, String> {
        let mut all = Self::default();
        all.add(name, text)?;
        all.resolve()?;
        Ok(all)
    }

    /// Adds the definitions in a text. Their types are not resolved.
    fn add(&mut self, name: &str, text: &str) -> Result<(), String> {
        let (mut name, mut fields) = (short_name(name), Vec::new());
        for line in text.lines().map(str::trim) {
            if let Some(next) = line.strip_prefix("MSG:") {
                let next = short_name(next.trim());
                let done = core::mem::replace(&mut name, next);
                self.types.insert(done, core::mem::take(&mut fields));
            } else if !line.starts_with("===") {
                fields.extend(field(line)?);
            }
        }
        self.types.insert(name, fields);
        Ok(())
    }

    /// The possible full names of the types that a text mentions and does not define.
    ///
    /// # Errors
    /// The text has a line that cannot be read.
    pub(super) fn missing(name: &str, text: &str) -> Result<BTreeSet<String>, String> {
        let mut all = Self::default();
        all.add(name, text)?;
        let mut missing = BTreeSet::new();
        for (owner, fields) in &all.types {
            for field in fields {
                if let Kind::Message(written) = &field.kind
                    && find(written, owner, all.types.keys()).is_none()
                {
                    missing.extend([written.clone(), near(written, owner)]);
                }
            }
        }
        Ok(missing)
    }

    /// Gives every nested type its full name.
    fn resolve(&mut self) -> Result<(), String> {
        let names: Vec<String> = self.types.keys().cloned().collect();
        for (owner, fields) in &mut self.types {
            for field in fields {
                if let Kind::Message(written) = &mut field.kind {
                    match written.as_str() {
                        "builtin_interfaces/Time" => field.kind = Kind::Time,
                        "builtin_interfaces/Duration" => field.kind = Kind::Duration,
                        _ => *written = full_name(written, owner, &names)?,
                    }
                }
            }
        }
        Ok(())
    }

    pub(super) fn fields(&self, name: &str) -> Option<&[Field]> {
        self.types.get(name).map(Vec::as_slice)
    }
}

/// The name of a type of the package of `owner`.
fn near(written: &str, owner: &str) -> String {
    let package = owner.split('/').next().unwrap_or_default();
    format!("{package}/{written}")
}

/// The full name, among those known, of a type that a definition of `owner` mentions.
fn find<'a>(written: &str, owner: &str, known: impl Iterator<Item = &'a String> + Clone) -> Option<&'a String> {
    let near = near(written, owner);
    let mut exact = known.clone();
    let mut by_last = known;
    exact
        .find(|name| *name == written || **name == near)
        .or_else(|| by_last.find(|name| name.rsplit('/').next() == Some(written)))
}

fn full_name(written: &str, owner: &str, known: &[String]) -> Result<String, String> {
    let missing = || format!("`{owner}` has a field of the type `{written}`, which is not defined");
    find(written, owner, known.iter()).cloned().ok_or_else(missing)
}

/// The field that a line declares; `None` for a constant, a comment or an empty line.
fn field(line: &str) -> Result<Option<Field>, String> {
    let line = line.split('#').next().unwrap_or_default().trim();
    if line.is_empty() {
        return Ok(None);
    }
    let unreadable = || format!("the line `{line}` of a definition cannot be read");
    let (written, rest) = line.split_once(char::is_whitespace).ok_or_else(unreadable)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if after.trim_start().starts_with('=') {
        return Ok(None);
    }
    let (written, array) = array(written).ok_or_else(unreadable)?;
    let kind = kind(written).ok_or_else(|| format!("the field `{name}` is a wide string, which is not read"))?;
    let name = name.to_owned();
    Ok(Some(Field { name, kind, array }))
}

/// Splits `float64[9]` into the type of its elements and their number.
fn array(written: &str) -> Option<(&str, Array)> {
    let Some(open) = written.find('[') else {
        return Some((written, Array::One));
    };
    let (element, count) = written.split_at(open);
    let count = count.strip_prefix('[')?.strip_suffix(']')?;
    let array = match count.strip_prefix("<=") {
        Some(_) => Array::Any,
        None if count.is_empty() => Array::Any,
        None => Array::Fixed(count.parse().ok()?),
    };
    Some((element, array))
}

/// The type with this name; `None` for a wide string.
fn kind(written: &str) -> Option<Kind> {
    // `string<=10` has at most ten characters.
    let name = written.split("<=").next().unwrap_or(written);
    let number = match name {
        "bool" | "uint8" | "char" | "byte" => Number::U8,
        "int8" => Number::I8,
        "int16" => Number::I16,
        "uint16" => Number::U16,
        "int32" => Number::I32,
        "uint32" => Number::U32,
        "int64" => Number::I64,
        "uint64" => Number::U64,
        "float32" => Number::F32,
        "float64" => Number::F64,
        "time" => return Some(Kind::Time),
        "duration" => return Some(Kind::Duration),
        "string" => return Some(Kind::Text),
        "wstring" => return None,
        // The name of ROS 1 for the header, which has no package there.
        "Header" => return Some(Kind::Message("std_msgs/Header".to_owned())),
        other => return Some(Kind::Message(short_name(other))),
    };
    Some(Kind::Number(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_gives_its_fields_without_constants_and_defaults() {
        let text = "# A comment\nuint8 FIX = 0\nstring NAME=a # b\nHeader header\nfloat64[9] cov 1 2\nstring<=10[<=5] names # c\n\
                    Point[] points\nint32 count 5\nbuiltin_interfaces/Time at\n\
                    ================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n===\nMSG: a/Point\nfloat32 x";
        let all = Definitions::parse("a/msg/Test", text).unwrap();
        let field = |name: &str, kind: Kind, array: Array| Field {
            name: name.to_owned(),
            kind,
            array,
        };
        let message = |name: &str| Kind::Message(name.to_owned());
        assert_eq!(
            all.fields("a/Test").unwrap(),
            [
                field("header", message("std_msgs/Header"), Array::One),
                field("cov", Kind::Number(Number::F64), Array::Fixed(9)),
                field("names", Kind::Text, Array::Any),
                field("points", message("a/Point"), Array::Any),
                field("count", Kind::Number(Number::I32), Array::One),
                field("at", Kind::Time, Array::One),
            ]
        );
        assert_eq!(all.fields("std_msgs/Header").unwrap().len(), 3);
        assert_eq!(all.fields("a/Point").unwrap().len(), 1);
    }

    #[test]
    fn what_is_wrong_with_a_definition_is_named() {
        for (text, part) in [
            ("other/Type x", "`other/Type`, which is not defined"),
            ("wstring x", "`x` is a wide string"),
            ("float64", "the line `float64`"),
            ("float64[x] y", "the line `float64[x] y`"),
        ] {
            let error = Definitions::parse("a/Test", text).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
