//! The plan for decoding the rows of a file: the declaration, checked before any file is opened.

use super::channel::ChannelPlan;
use super::clock::Clock;
use super::spec::{ChannelSpec, Interval, Repeats, RowSpec, Ties};
use crate::rows::{ProvidedChannel, provided};
use fusion_models::block::BuildError;

/// A checked declaration; columns are still names.
#[derive(Debug)]
pub struct Plan<'a> {
    pub(super) spec: RowSpec<'a>,
    pub(super) clock: Clock,
    pub(super) channels: Vec<ChannelPlan>,
}

impl<'a> RowSpec<'a> {
    /// Checks everything that can be checked without the file; all mistakes go to `errors`.
    pub(in super::super) fn plan(self, errors: &mut Vec<BuildError>) -> Plan<'a> {
        let clock = Clock::new(&self.stamp, self.timing, errors);
        let channels = self.channels.iter();
        let channels = channels.filter_map(|(name, spec)| ChannelPlan::new(name, spec, errors)).collect();
        self.check_rows(errors);
        self.check_increments(errors);
        Plan {
            spec: self,
            clock,
            channels,
        }
    }

    /// The same.
    ///
    /// # Errors
    /// All mistakes, each naming its field.
    pub fn checked(self) -> Result<Plan<'a>, Vec<BuildError>> {
        let mut errors = Vec::new();
        let plan = self.plan(&mut errors);
        if errors.is_empty() { Ok(plan) } else { Err(errors) }
    }

    /// GPS time at time zero of the rows \[ns\]; `None` if the zero point of the stamps is not declared.
    #[must_use]
    pub fn time_zero(&self) -> Option<i64> {
        Clock::new(&self.stamp, self.timing, &mut Vec::new()).time_zero()
    }

    fn check_rows(&self, errors: &mut Vec<BuildError>) {
        let channels = self.channels.iter();
        let of_channels = channels.flat_map(|(name, channel)| channel.valid.0.iter().map(move |c| (format!("channels.{name}.valid"), c)));
        let of_rows = self.valid.0.iter().map(|c| ("valid".to_owned(), c));
        for (field, condition) in of_rows.chain(of_channels) {
            if condition.is_empty() {
                let message = format!("no condition is set on column `{}`", condition.column);
                errors.push(BuildError::at(field, message).help("add `equals`, `not_equals`, `at_least` or `at_most`"));
            }
        }
        let remembers = |channel: &ChannelSpec| (channel.increment || channel.average) && !channel.valid.0.is_empty();
        for (name, _) in self.channels.iter().filter(|(_, channel)| remembers(channel)) {
            let message = "increments and means take every row, so that none may be left out";
            let help = "leave out the rows themselves: `valid` of the source";
            errors.push(BuildError::at(format!("channels.{name}.valid"), message).help(help));
        }
        if self.keep.is_some_and(|keep| keep.every.is_some() == keep.except_every.is_some()) {
            errors.push(BuildError::at("keep", "rows are kept by `every` or by `except_every`"));
        }
    }

    fn check_increments(&self, errors: &mut Vec<BuildError>) {
        if self.interval == Interval::Nominal && self.rate.is_none() {
            errors.push(BuildError::at("interval", "a nominal interval needs the nominal `rate`"));
        }
        let Some((name, _)) = self.channels.iter().find(|(_, channel)| channel.increment) else {
            return;
        };
        if self.keep.is_some() {
            let message = format!("`{name}` holds increments, and rows that are left out would take their motion with them");
            errors.push(BuildError::at("keep", message));
        }
        if self.timing.ties == Ties::Keep {
            let message = format!("`{name}` holds increments, which have no rate over no time");
            errors.push(BuildError::at("time.ties", message));
        }
    }

    /// Whether rows that repeat the one before are left out.
    pub(super) fn drops_repeats(&self) -> bool {
        self.repeats == Repeats::Drop
    }
}

impl Plan<'_> {
    /// The columns that its channels read, as declared.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let inputs = self.channels.iter().flat_map(|channel| &channel.inputs);
        inputs.flat_map(|input| input.columns.iter().map(String::as_str))
    }

    /// The channels of a row.
    #[must_use]
    pub fn provided(&self) -> Vec<ProvidedChannel> {
        provided(self.channels.iter().map(|plan| (plan.channel.clone(), plan.delay_ns)))
    }
}
