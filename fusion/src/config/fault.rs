//! The mistakes that serde finds, kept by kind until they become messages.

use std::fmt;

use serde::de::{Error, Expected, Unexpected};

use super::diagnostic::{Diagnostic, Place};

type Names = &'static [&'static str];

/// A mistake as serde reports it, so far without a place.
#[derive(Clone, Debug)]
pub(super) enum Fault {
    /// A sentence, of a range check for instance.
    Said(String),
    Unexpected {
        found: String,
        wanted: String,
    },
    /// An array instead of a table with named fields.
    ArrayForTable {
        fields: Names,
    },
    UnknownField {
        field: String,
        known: Names,
    },
    /// No such type of block, no such word.
    UnknownVariant {
        variant: String,
        known: Names,
    },
    MissingField(&'static str),
    MissingType {
        known: Names,
    },
}

impl Fault {
    /// The same fault, with the names that were expected.
    pub(super) fn among(self, names: Names) -> Self {
        match self {
            Self::Unexpected { found, .. } => Self::Unexpected {
                found,
                wanted: format!("one of `{}`, alone or as the `type` of a table", names.join("`, `")),
            },
            other => other,
        }
    }

    /// The mistake, made at `place`; `moved` are fields that would be known elsewhere.
    pub(super) fn diagnose(&self, place: &Place, moved: &[String]) -> Diagnostic {
        let diagnostic = Diagnostic::error(self.to_string()).at(place);
        match self {
            Self::Said(_) | Self::Unexpected { .. } => diagnostic,
            Self::ArrayForTable { fields } => {
                let fields: Vec<String> = fields.iter().map(|field| format!("{field} = …")).collect();
                diagnostic.help(format!("name its fields: `{{ {} }}`", fields.join(", ")))
            }
            Self::UnknownField { field, known } => {
                let moved = moved.iter().map(String::as_str);
                let known: Vec<&str> = known.iter().copied().chain(moved).collect();
                diagnostic.suggest(field, &known, "known fields")
            }
            Self::UnknownVariant { variant, known } => diagnostic.suggest(variant, known, "known"),
            Self::MissingField(field) => diagnostic.label(format!("needs `{field}`")),
            Self::MissingType { known } => diagnostic.suggest("", known, "known types").label("needs `type`"),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Said(sentence) => f.write_str(sentence),
            Self::Unexpected { found, wanted } => write!(f, "expected {wanted}, found {found}"),
            Self::ArrayForTable { .. } => f.write_str("expected a table, found an array"),
            Self::UnknownField { field, .. } => write!(f, "unknown field `{field}`"),
            Self::UnknownVariant { variant, .. } => write!(f, "unknown name `{variant}`"),
            Self::MissingField(field) => write!(f, "missing field `{field}`"),
            Self::MissingType { .. } => f.write_str("missing field `type`"),
        }
    }
}

impl std::error::Error for Fault {}

impl Error for Fault {
    fn custom<T: fmt::Display>(sentence: T) -> Self {
        Self::Said(sentence.to_string())
    }

    fn invalid_type(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        let found = match unexpected {
            Unexpected::Str(text) => format!("the text {text:?}"),
            Unexpected::Bool(flag) => format!("`{flag}`"),
            Unexpected::Signed(number) => format!("the integer `{number}`"),
            Unexpected::Float(number) => format!("the number `{number:?}`"),
            Unexpected::Seq => "an array".to_owned(),
            Unexpected::Map => "a table".to_owned(),
            other => other.to_string(),
        };
        let wanted = in_words(&expected.to_string());
        Self::Unexpected { found, wanted }
    }

    fn invalid_value(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(unexpected, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let found = match length {
            1 => "1 element".to_owned(),
            _ => format!("{length} elements"),
        };
        let wanted = in_words(&expected.to_string());
        Self::Unexpected { found, wanted }
    }

    fn unknown_variant(variant: &str, known: Names) -> Self {
        let variant = variant.to_owned();
        Self::UnknownVariant { variant, known }
    }

    fn unknown_field(field: &str, known: Names) -> Self {
        let field = field.to_owned();
        Self::UnknownField { field, known }
    }

    fn missing_field(field: &'static str) -> Self {
        Self::MissingField(field)
    }
}

/// The type that serde expects, in words for readers who do not know Rust.
fn in_words(expected: &str) -> String {
    match expected {
        "f64" | "f32" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number of at least 0",
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number",
        "a nonzero u8" | "a nonzero u16" | "a nonzero u32" | "a nonzero u64" | "a nonzero usize" => "a whole number of at least 1",
        "a boolean" => "`true` or `false`",
        "a string" | "path string" => "text",
        "a sequence" => "an array",
        "a map" => "a table",
        block if block.starts_with("dyn ") => "a table with a `type`",
        table if table.starts_with("struct ") => "a table",
        variant if variant.starts_with("enum ") => "a word, or a table with a `type`",
        other => return other.replace("an array of length ", "an array of "),
    }
    .to_owned()
}
