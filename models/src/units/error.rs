//! Errors of a quantity, in words for the person who wrote it.

use std::fmt;

use super::catalogue;
use super::dimension::{Dimension, QuantityKind};

/// A quantity or a unit that cannot be read, or is not the required one.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UnitError {
    /// The text does not begin with a number, or the number is not finite.
    Number {
        /// The written text.
        text: String,
    },
    /// No unit has this symbol.
    UnknownUnit {
        /// The written text.
        text: String,
        /// The unknown part of the text.
        unit: String,
        /// The unit that was probably meant.
        suggestion: Option<String>,
    },
    /// The unit expression is malformed.
    Syntax {
        /// The written text.
        text: String,
        /// The problem of the expression.
        problem: &'static str,
    },
    /// The quantity has another dimension than the required one.
    WrongDimension {
        /// The written text.
        text: String,
        /// Its dimension.
        found: Dimension,
        /// The required dimension.
        wanted: QuantityKind,
    },
    /// The value is outside the allowed range.
    OutOfRange {
        /// The written text.
        text: String,
        /// The dimension, which is correct.
        wanted: QuantityKind,
        /// The range, as in `greater than 0`.
        range: &'static str,
        /// The text that was probably meant.
        meant: Option<String>,
    },
    /// Another error of reading, with the required dimension, if it is known.
    Expected {
        /// The error.
        why: Box<UnitError>,
        /// The required dimension.
        wanted: QuantityKind,
    },
    /// There are more or fewer quantities than axes.
    Count {
        /// The number of written quantities.
        given: usize,
        /// The kind of quantity of each axis.
        axes: Vec<QuantityKind>,
        /// True if one quantity would be valid for all axes.
        or_one: bool,
    },
    /// One of several quantities is wrong.
    Element {
        /// Its index, from 0.
        index: usize,
        /// The error of this element.
        why: Box<UnitError>,
    },
}

impl std::error::Error for UnitError {}

impl fmt::Display for UnitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { text } => {
                write!(f, "{text:?} is not a finite number followed by a unit")
            }
            Self::UnknownUnit { text, unit, suggestion } => {
                write!(f, "unknown unit `{unit}`")?;
                if text != unit {
                    write!(f, " in {text:?}")?;
                }
                write_meant(f, suggestion.as_deref())
            }
            Self::Expected { why, wanted } => {
                match &**why {
                    Self::UnknownUnit { text, unit, .. } => write!(f, "unknown unit `{unit}` in {text:?}")?,
                    other => write!(f, "{other}")?,
                }
                write!(f, "; {wanted} is expected here")?;
                write_example(f, wanted)?;
                match &**why {
                    Self::UnknownUnit { unit, .. } => write_meant(f, catalogue::suggest(unit, Some(wanted.dimension)).as_deref()),
                    _ => Ok(()),
                }
            }
            Self::Syntax { text, problem } => write!(f, "{text:?} is not a unit: {problem}"),
            Self::WrongDimension { text, found, wanted } => {
                match text.trim().parse::<f64>() {
                    Ok(_) => write!(f, "{text:?} has no unit")?,
                    Err(_) => write!(f, "{text:?} is {}", found.kind())?,
                }
                write!(f, "; {wanted} is expected here")?;
                write_example(f, wanted)
            }
            Self::OutOfRange {
                text,
                wanted,
                range,
                meant,
            } => {
                match text.parse::<f64>() {
                    Ok(_) => write!(f, "{text} is out of range")?,
                    Err(_) => write!(f, "{text:?} is out of range")?,
                }
                write!(f, "; {wanted} {range} is expected here")?;
                write_example(f, wanted)?;
                match meant {
                    Some(meant) => write!(f, "; a bare number is in {}: was {meant:?} meant?", wanted.symbol),
                    None => Ok(()),
                }
            }
            Self::Count { given, axes, or_one } => write_count(f, *given, axes, *or_one),
            Self::Element { why, .. } => why.fmt(f),
        }
    }
}

impl UnitError {
    /// The error for `given` quantities instead of one for each of these axes.
    #[must_use]
    pub fn count(given: usize, axes: &[Dimension], or_one: bool) -> Self {
        let axes = axes.iter().map(|dimension| dimension.kind()).collect();
        Self::Count { given, axes, or_one }
    }

    /// The path of the error in `field`: an element of it, if it is an array.
    #[must_use]
    pub fn path(&self, field: &str) -> String {
        match self {
            Self::Element { index, .. } => format!("{field}.{index}"),
            _ => field.to_owned(),
        }
    }
}

/// Writes the unit that was probably meant.
fn write_meant(f: &mut fmt::Formatter<'_>, known: Option<&str>) -> fmt::Result {
    known.map_or(Ok(()), |known| write!(f, "; did you mean `{known}`?"))
}

fn write_example(f: &mut fmt::Formatter<'_>, wanted: &QuantityKind) -> fmt::Result {
    write!(f, ", e.g. {:?}", example(wanted))
}

/// A valid example; one tenth of the SI unit if the dimension has no name.
fn example(wanted: &QuantityKind) -> String {
    match wanted.example {
        "" => format!("0.1 {}", wanted.dimension),
        example => example.to_owned(),
    }
}

fn write_count(f: &mut fmt::Formatter<'_>, given: usize, axes: &[QuantityKind], or_one: bool) -> fmt::Result {
    let examples: Vec<String> = axes.iter().map(|axis| format!("{:?}", example(axis))).collect();
    let examples = examples.join(", ");
    match (axes, or_one) {
        ([], _) => write!(f, "no values are expected here, not {given}"),
        ([_], _) => write!(f, "one value is expected here, e.g. {examples}, not {given}"),
        (_, true) => write!(
            f,
            "{} values, or one for all, are expected here, e.g. [{examples}], not {given}",
            axes.len()
        ),
        (_, false) => write!(f, "{} values are expected here, e.g. [{examples}], not {given}", axes.len()),
    }
}
