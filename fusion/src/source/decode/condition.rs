//! Conditions that a row has to meet.

use super::one_or_many::OneOrMany;
use super::raw::Cell;
use super::spec::{Condition, Wanted};

/// A condition whose column is known.
#[derive(Debug)]
pub(super) struct Test {
    pub(super) column: usize,
    equals: Option<Vec<Wanted>>,
    not_equals: Option<Vec<Wanted>>,
    at_least: Option<f64>,
    at_most: Option<f64>,
}

impl Test {
    pub(super) fn new(condition: &Condition, column: usize) -> Self {
        let values = |of: &Option<OneOrMany<Wanted>>| of.as_ref().map(|wanted| wanted.0.clone());
        Self {
            column,
            equals: values(&condition.equals),
            not_equals: values(&condition.not_equals),
            at_least: condition.at_least,
            at_most: condition.at_most,
        }
    }

    /// Returns true if the cell meets it; `None` if a number is wanted and the cell has no number.
    pub(super) fn holds(&self, cell: Cell<'_>) -> Option<bool> {
        if matches!(cell, Cell::Text(_)) {
            cell.text()?;
        }
        let number = cell.number();
        let is_equal = self.equals.as_ref().map_or(Some(true), |wanted| is_any_of(wanted, cell, number));
        let is_excluded = self
            .not_equals
            .as_ref()
            .map_or(Some(false), |wanted| is_any_of(wanted, cell, number));
        let is_within = match (self.at_least, self.at_most) {
            (None, None) => Some(true),
            (least, most) => number.map(|n| least.is_none_or(|least| n >= least) && most.is_none_or(|most| n <= most)),
        };
        Some(is_equal? && !is_excluded? && is_within?)
    }
}

/// Returns true if the cell has one of the values. A text that is not a number gives `None`, unless texts are
/// among the values.
fn is_any_of(wanted: &[Wanted], cell: Cell<'_>, number: Option<f64>) -> Option<bool> {
    let is_one = wanted.iter().any(|wanted| match wanted {
        Wanted::Text(text) => cell.text() == Some(text),
        Wanted::Number(wanted) => number == Some(*wanted),
    });
    let wants_text = wanted.iter().any(|w| matches!(w, Wanted::Text(_)));
    (is_one || wants_text || number.is_some()).then_some(is_one)
}
