//! The first measurement that two runs treat differently.
//!
//! A *ledger* is a text file with a line for each measurement that was offered to a filter: its row, and all numbers that
//! the filter computed of it before the update, each with all its digits. Two runs with equal ledgers have equal
//! estimates at every measurement. If they differ, the first line that differs is where the cause acts first.

mod ledger;

pub use ledger::{Entry, Ledger, LedgerWriter};

use std::io::{self, BufRead};

/// The first difference between two ledgers.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The number of measurements before it, which are equal.
    pub equal: u64,
    /// The last of them.
    pub before: Option<Entry>,
    /// The measurement of the first ledger; `None` if it has ended.
    pub first: Option<Entry>,
    /// The measurement of the second ledger at this place; `None` if it has ended.
    pub second: Option<Entry>,
}

impl Difference {
    /// The names of the fields that differ, with the contents of both.
    #[must_use]
    pub fn fields(&self) -> Vec<(&str, &str, &str)> {
        let (Some(first), Some(second)) = (&self.first, &self.second) else {
            return Vec::new();
        };
        let both = first.fields().zip(second.fields());
        both.filter(|((_, a), (_, b))| a != b)
            .map(|((name, a), (_, b))| (name, a, b))
            .collect()
    }
}

/// Compares two ledgers; `Err` with the number of measurements if all are equal.
///
/// # Errors
/// A ledger cannot be read.
pub fn bisect(first: &mut Ledger<impl BufRead>, second: &mut Ledger<impl BufRead>) -> io::Result<Result<Difference, u64>> {
    let mut before = None;
    for equal in 0.. {
        match (first.next()?, second.next()?) {
            (None, None) => return Ok(Err(equal)),
            (Some(a), Some(b)) if a == b => before = Some(a),
            (first, second) => {
                return Ok(Ok(Difference {
                    equal,
                    before,
                    first,
                    second,
                }));
            }
        }
    }
    Ok(Err(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ledger(lines: &[&str]) -> Ledger<io::Cursor<String>> {
        Ledger::read(io::Cursor::new(format!("{}{}\n", ledger::HEAD, lines.join("\n")))).unwrap()
    }

    const ONE: &str = "5\tgnss\t1\taccepted\t0.5\t1,2\t1,2\t1\t0.25,-1e-300\t1";

    #[test]
    fn the_first_difference_is_found_with_its_fields() {
        let other = ONE.replace("0.25,-1e-300", "0.25,-2e-300").replace("5\t", "6\t");
        let third = ONE.replace("5\t", "6\t");
        let found = bisect(&mut ledger(&[ONE, &other, ONE]), &mut ledger(&[ONE, &third, ONE]))
            .unwrap()
            .unwrap();
        assert_eq!(found.equal, 1);
        assert_eq!(found.before.as_ref().map(Entry::time_ns), Some(5));
        assert_eq!(found.fields(), [("residual", "0.25,-2e-300", "0.25,-1e-300")]);
    }

    #[test]
    fn equal_ledgers_are_counted_and_a_shorter_one_is_a_difference() {
        assert_eq!(bisect(&mut ledger(&[ONE, ONE]), &mut ledger(&[ONE, ONE])).unwrap(), Err(2));
        let found = bisect(&mut ledger(&[ONE]), &mut ledger(&[ONE, ONE])).unwrap().unwrap();
        assert!(found.first.is_none() && found.second.is_some() && found.equal == 1);
    }

    #[test]
    fn another_file_is_no_ledger() {
        assert!(Ledger::read(io::Cursor::new("t_s,sensor\n")).is_err());
        assert!(ledger(&["5\tgnss"]).next().is_err());
    }
}
