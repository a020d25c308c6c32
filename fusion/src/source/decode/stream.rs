//! The stream of decoded rows of a file.

use super::ahead::Ahead;
use super::channel::ChannelPlan;
use super::condition::Test;
use super::judge::{Judge, Places, Term, Unused};
use super::plan::Plan;
use super::raw::RawRows;
use super::spec::{Condition, Policy, RowSpec};
use crate::config::did_you_mean;
use crate::rows::{DataError, Example, ProvidedChannel, RowCounts, RowStream, SourceError, SourceReport, Stamp, width};
use crate::source::OpenContext;
use crate::source::file::DataFile;
use core::fmt;
use fusion_models::block::BuildError;

/// The decoded rows of one file.
struct Decoded<R> {
    file: String,
    raw: Ahead<R>,
    judge: Judge,
    provided: Vec<ProvidedChannel>,
    /// Columns that no channel reads.
    unread: Vec<String>,
    counts: RowCounts,
    has_ended: bool,
}

impl Plan<'_> {
    /// Decodes the rows of `raw`; looks up its columns.
    ///
    /// # Errors
    /// Columns that the file does not have, a local position without an origin.
    pub fn decode<R: RawRows + 'static>(
        mut self,
        mut raw: R,
        file: &DataFile,
        context: &OpenContext,
    ) -> Result<Box<dyn RowStream>, SourceError> {
        self.set_origin(context)?;
        let provided = self.provided();
        let unread = self.unread(&raw);
        let mut columns = Columns {
            raw: &raw,
            file,
            errors: Vec::new(),
        };
        let places = Places {
            stamp: self
                .spec
                .stamp
                .columns
                .iter()
                .map(|(field, column)| columns.find(field, column))
                .collect(),
            terms: self.channels.iter().map(|plan| columns.terms(plan)).collect(),
            valid: columns.tests("valid", &self.spec.valid.0),
            valid_channels: self.channels.iter().map(|plan| columns.conditions(&self.spec, plan)).collect(),
        };
        if !columns.errors.is_empty() {
            return Err(columns.errors.into());
        }
        raw.select(&places.columns());
        Ok(Box::new(Decoded {
            file: file.name(),
            judge: Judge::new(self, places, context.arriving.is_some()),
            raw: Ahead::new(raw),
            provided,
            unread,
            counts: RowCounts::default(),
            has_ended: false,
        }))
    }

    /// The columns of the file that no channel reads, by name or by number.
    fn unread(&self, raw: &dyn RawRows) -> Vec<String> {
        let is_read = |(k, name): &(usize, &String)| {
            let is_number = |read: &str| raw.is_numbered() && read.parse() == Ok(k + 1);
            self.columns().any(|read| read == name.as_str() || is_number(read))
        };
        let unread = raw.columns().iter().enumerate().filter(|column| !is_read(column));
        unread.map(|(_, name)| name.clone()).collect()
    }

    fn set_origin(&mut self, context: &OpenContext) -> Result<(), SourceError> {
        for plan in self.channels.iter_mut().filter(|plan| plan.needs_origin()) {
            let missing = |plan: &ChannelPlan| {
                let field = format!("channels.{}", plan.channel.name);
                let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
                BuildError::at(field, "metres north, east and down need an origin").help(help)
            };
            let origin = context.origin.ok_or_else(|| missing(plan))?;
            plan.set_origin(origin);
        }
        Ok(())
    }
}

/// The columns of a file, and the errors of names that were not found.
struct Columns<'a> {
    raw: &'a dyn RawRows,
    file: &'a DataFile,
    errors: Vec<BuildError>,
}

impl Columns<'_> {
    /// The numbers of the columns with this name, from 0. A name that no column has may be the number of a column.
    fn positions(&self, name: &str) -> Vec<usize> {
        let columns = self.raw.columns();
        let named: Vec<usize> = (0..columns.len()).filter(|k| columns[*k] == name).collect();
        if !named.is_empty() || !self.raw.is_numbered() {
            return named;
        }
        let number = name.parse().ok().filter(|number| (1..=columns.len()).contains(number));
        number.map(|number: usize| number - 1).into_iter().collect()
    }

    /// The number of a column.
    fn find(&mut self, field: &str, name: &str) -> usize {
        match self.positions(name)[..] {
            [] => self.missing(field, name),
            [one] => one,
            ref several => self.ambiguous(field, name, several),
        }
    }

    /// The number of a column and the sign before its name.
    fn find_signed(&mut self, field: &str, name: &str) -> (usize, f64) {
        match name.strip_prefix('-') {
            Some(bare) if self.positions(name).is_empty() => (self.find(field, bare), -1.0),
            _ => (self.find(field, name), 1.0),
        }
    }

    fn ambiguous(&mut self, field: &str, name: &str, columns: &[usize]) -> usize {
        let numbers: Vec<String> = columns.iter().map(|k| format!("`{}`", k + 1)).collect();
        let message = format!("`{}` has {} columns `{name}`", self.file.declared.display(), columns.len());
        let help = if self.raw.is_numbered() {
            format!(
                "write the number of the column that is meant instead of its name: {}. Or name all columns by `names`, and pass over \
                 the line with theirs by `skip = 1`",
                numbers.join(" or ")
            )
        } else {
            "give them different names".to_owned()
        };
        let error = BuildError::at(field, message).help(help);
        // A name that a channel reads three times is one mistake.
        if !self.errors.contains(&error) {
            self.errors.push(error);
        }
        0
    }

    /// The cells that a channel reads.
    fn terms(&mut self, plan: &ChannelPlan) -> Vec<Term> {
        let mut terms = Vec::new();
        for (number, input) in plan.inputs.iter().enumerate() {
            let field = format!("channels.{}.{}", plan.channel.name, input.field);
            for name in &input.columns {
                let (column, sign) = self.find_signed(&field, name);
                let sign = if input.is_reversed { -sign } else { sign };
                terms.push(Term { column, sign, number });
            }
        }
        terms
    }

    fn tests(&mut self, field: &str, conditions: &[Condition]) -> Vec<Test> {
        conditions.iter().map(|c| Test::new(c, self.find(field, &c.column))).collect()
    }

    /// The conditions of a channel.
    fn conditions(&mut self, spec: &RowSpec<'_>, plan: &ChannelPlan) -> Vec<Test> {
        let conditions = spec.channels.get(&*plan.channel.name).map_or(&[][..], |spec| &spec.valid.0);
        self.tests(&format!("channels.{}.valid", plan.channel.name), conditions)
    }

    fn missing(&mut self, field: &str, name: &str) -> usize {
        let known: Vec<&str> = self.raw.columns().iter().map(String::as_str).collect();
        let meant = did_you_mean(name, &known)
            .map(|meant| format!("did you mean `{meant}`? "))
            .unwrap_or_default();
        let why = self.raw.absent(name).map(|why| format!(": {why}")).unwrap_or_default();
        let error = BuildError::at(field, format!("`{}` has no column `{name}`{why}", self.file.declared.display()));
        let help = format!("{meant}its columns: `{}`", known.join("`, `"));
        self.errors.push(error.help(help));
        0
    }
}

impl<R> fmt::Debug for Decoded<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Decoded").field("file", &self.file).finish_non_exhaustive()
    }
}

impl<R: RawRows> RowStream for Decoded<R> {
    fn channels(&self) -> &[ProvidedChannel] {
        &self.provided
    }

    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError> {
        if self.has_ended {
            return Ok(None);
        }
        values.clear();
        values.resize(width(&self.provided), 0.0);
        let next = self.advance(values);
        self.has_ended = !matches!(next, Ok(Some(_)));
        next
    }

    fn report(&self) -> SourceReport {
        SourceReport {
            unread: self.unread.clone(),
            ..self.counts.report()
        }
    }
}

impl<R: RawRows> Decoded<R> {
    fn advance(&mut self, values: &mut [f64]) -> Result<Option<Stamp>, SourceError> {
        while self.raw.advance()? {
            let place = self.raw.place();
            match self.judge.decode(self.counts.rows(), &mut self.raw, values) {
                Ok(time) => {
                    self.counts.row();
                    self.counts.used(time);
                    let number = place as u64;
                    return Ok(Some(Stamp::new(time, number)));
                }
                Err(Unused::Left(reason)) => {
                    self.counts.row();
                    self.counts.skipped(reason, None);
                }
                Err(Unused::Wrong(wrong)) => match wrong.policy {
                    Policy::Skip => {
                        self.counts.row();
                        let (number, counted, what) = (place, self.raw.counted().into(), wrong.message);
                        self.counts.skipped(wrong.reason, Some(Example { number, counted, what }));
                    }
                    Policy::Stop => {
                        let error = DataError::new(self.file.as_str(), wrong.message);
                        return Err(error.row(self.raw.counted(), place).help(wrong.help).into());
                    }
                },
                Err(Unused::End) => break,
            }
        }
        self.end()
    }

    /// The end; an error if no row was delivered.
    fn end(&self) -> Result<Option<Stamp>, SourceError> {
        let report = self.counts.report();
        if report.used > 0 {
            return Ok(None);
        }
        let file = self.file.as_str();
        if report.rows == 0 && !self.judge.has_seen_a_stamp() {
            return Err(SourceError::NoRow(Box::new(DataError::new(file, "this file has no rows"))));
        }
        let reasons: Vec<String> = report.skipped.iter().map(|s| format!("{} × {}", s.count, s.reason)).collect();
        let why = if reasons.is_empty() {
            "the first is after the declared stop".to_owned()
        } else {
            reasons.join(", ")
        };
        let error = DataError::new(file, format!("no row of this file can be used: {why}"));
        let example = report.skipped.iter().flat_map(|s| &s.examples).next();
        Err(SourceError::NoRow(Box::new(match example {
            Some(example) => error
                .row(self.raw.counted(), example.number)
                .help(format!("this is the first one: {}", example.what)),
            None => error,
        })))
    }
}
