//! Rows through declared faults, applied in the order in which they are declared.

use super::{ProvidedChannel, RowCounts, RowStream, SourceError, SourceReport, Stamp};
use core::ops::Range;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use fusion_models::fault::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use std::collections::VecDeque;

/// Faults as declared, by name.
type Declared = [(String, Box<dyn FaultSpec>)];

/// The faults at work on one stream, recorded or simulated, and what they did to it.
///
/// Delayed and repeated rows wait in the chain. [`reach`](Self::reach) sets how far the log has come, and
/// [`due`](Self::due) hands out the rows that are due, by arrival.
#[derive(Debug, Default)]
pub(crate) struct FaultChain {
    faults: Vec<(String, Box<dyn Fault>)>,
    /// The disturbed numbers of the last row delivered.
    disturbed: Vec<Range<usize>>,
    /// By arrival; rows with equal arrivals keep the order of the source.
    waiting: VecDeque<Waiting>,
    reached: Option<Time>,
    counts: RowCounts,
}

/// A row that is on its way.
#[derive(Debug)]
struct Waiting {
    stamp: Stamp,
    values: Vec<f64>,
    disturbed: Vec<Range<usize>>,
}

/// The combined effect of the faults on a row.
#[derive(Debug, Default)]
struct Fate {
    /// Added to its stamp \[ns\].
    restamped: i64,
    /// Added to its arrival \[ns\].
    delayed: i64,
    /// How often it comes again.
    copies: u32,
}

impl FaultChain {
    /// Builds `declared` for rows of `channels`; `seed_of` gives the seed of a fault by its name.
    ///
    /// # Errors
    /// All mistakes of the faults, the fields named `fault.<name>.<field>`.
    pub(crate) fn new(declared: &Declared, channels: &[ProvidedChannel], seed_of: impl Fn(&str) -> u64) -> Result<Self, Vec<BuildError>> {
        let (mut chain, mut errors) = (Self::default(), Vec::new());
        for (name, spec) in declared {
            let seed = seed_of(name);
            match spec.build(&FaultContext { channels, seed }) {
                Ok(fault) => chain.faults.push((name.clone(), fault)),
                Err(error) => errors.push(error.within(format!("fault.{name}"))),
            }
        }
        if errors.is_empty() { Ok(chain) } else { Err(errors) }
    }

    /// Sends a row through the faults; returns its stamp where it arrives now. Where it does not, it
    /// is lost or waits; so it does where it `queues` behind one that is due before it.
    pub(crate) fn pass(&mut self, stamp: Stamp, values: &mut [f64], queues: bool) -> Option<Stamp> {
        let fate = self.fate(stamp.time, values)?;
        let stamp = Stamp {
            time: stamp.time.shifted(fate.restamped),
            arrival: stamp.arrival.shifted(fate.delayed),
            ..stamp
        };
        let arrives_now = fate.delayed == 0 && !queues;
        for _ in u32::from(arrives_now)..=fate.copies {
            self.wait(stamp, values);
        }
        arrives_now.then(|| {
            self.counts.used(stamp.time);
            stamp
        })
    }

    /// Applies the faults to a row; `None` if a fault withholds it, and later faults then do not see it.
    fn fate(&mut self, time: Time, values: &mut [f64]) -> Option<Fate> {
        self.disturbed.clear();
        let mut fate = Fate::default();
        for (name, fault) in &mut self.faults {
            let outcome = fault.apply(time, values);
            match outcome {
                RowOutcome::Untouched => continue,
                RowOutcome::Withheld => {
                    self.counts.skipped(&format!("withheld by fault {name}"), None);
                    return None;
                }
                RowOutcome::Disturbed => {}
                RowOutcome::Restamped { by } => fate.restamped = fate.restamped.saturating_add(by),
                RowOutcome::Delayed { by } => fate.delayed = fate.delayed.saturating_add(by),
                RowOutcome::Repeated { copies } => fate.copies = fate.copies.saturating_add(copies),
            }
            if matches!(outcome, RowOutcome::Disturbed | RowOutcome::Restamped { .. }) {
                self.disturbed.push(fault.columns());
            }
            self.counts.disturbed(name);
        }
        Some(fate)
    }

    fn wait(&mut self, stamp: Stamp, values: &[f64]) {
        let after = self.waiting.partition_point(|w| w.stamp.arrival <= stamp.arrival);
        let row = Waiting {
            stamp,
            values: values.to_vec(),
            disturbed: self.disturbed.clone(),
        };
        self.waiting.insert(after, row);
    }

    /// The log has come to `time`.
    pub(crate) fn reach(&mut self, time: Time) {
        self.reached = self.reached.max(Some(time));
    }

    /// When the next of the waiting rows arrives, if the log has come as far.
    pub(crate) fn due(&self) -> Option<Time> {
        let arrival = self.waiting.front()?.stamp.arrival;
        (Some(arrival) <= self.reached).then_some(arrival)
    }

    /// Whether no row waits.
    pub(crate) fn is_idle(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Delivers the waiting row that is due.
    pub(crate) fn deliver(&mut self, values: &mut Vec<f64>) -> Option<Stamp> {
        self.due()?;
        let row = self.waiting.pop_front()?;
        values.clear();
        values.extend_from_slice(&row.values);
        self.disturbed = row.disturbed;
        self.counts.used(row.stamp.time);
        Some(row.stamp)
    }

    /// The numbers of the last row delivered that were disturbed.
    pub(crate) fn disturbed(&self) -> &[Range<usize>] {
        &self.disturbed
    }

    /// The numbers that its faults may disturb.
    pub(crate) fn disturbable(&self) -> impl Iterator<Item = Range<usize>> {
        self.faults.iter().map(|(_, fault)| fault.columns()).filter(|c| !c.is_empty())
    }

    /// The effects of the faults, added to the report of the input rows.
    pub(crate) fn report(&self, before: SourceReport) -> SourceReport {
        let own = self.counts.report();
        SourceReport {
            rows: before.rows,
            unread: before.unread,
            skipped: before.skipped.into_iter().chain(own.skipped).collect(),
            disturbed: before.disturbed.into_iter().chain(own.disturbed).collect(),
            ..own
        }
    }
}

/// A stream whose rows go through faults.
#[derive(Debug)]
pub(crate) struct Faulted {
    inner: Box<dyn RowStream>,
    faults: FaultChain,
}

impl Faulted {
    /// The rows of `inner` through the faults declared for it, by name; `seed_of` gives the seed of
    /// a fault by its name.
    ///
    /// # Errors
    /// All mistakes of the faults, the fields named `fault.<name>.<field>`.
    pub fn new(inner: Box<dyn RowStream>, declared: &Declared, seed_of: impl Fn(&str) -> u64) -> Result<Self, Vec<BuildError>> {
        let faults = FaultChain::new(declared, inner.channels(), seed_of)?;
        Ok(Self { inner, faults })
    }
}

impl RowStream for Faulted {
    fn channels(&self) -> &[ProvidedChannel] {
        self.inner.channels()
    }

    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError> {
        loop {
            if let Some(stamp) = self.faults.deliver(values) {
                return Ok(Some(stamp));
            }
            match self.inner.next(values)? {
                Some(stamp) => {
                    self.faults.reach(stamp.arrival);
                    let queues = self.faults.due().is_some();
                    if let Some(stamp) = self.faults.pass(stamp, values, queues) {
                        return Ok(Some(stamp));
                    }
                }
                // After the end of the log what is still on its way arrives.
                None if self.faults.is_idle() => return Ok(None),
                None => self.faults.reach(Time::MAX),
            }
        }
    }

    fn disturbed(&self) -> &[Range<usize>] {
        self.faults.disturbed()
    }

    fn disturbable(&self) -> Vec<Range<usize>> {
        self.faults.disturbable().collect()
    }

    /// Rows, stamps and gaps as delivered; rows that the source itself left out come first.
    fn report(&self) -> SourceReport {
        self.faults.report(self.inner.report())
    }
}

/// When a stream is silent because of its declared outages: the windows of each outage.
pub(crate) fn outages(declared: &Declared) -> impl Iterator<Item = &Windows> {
    declared.iter().filter_map(|(_, spec)| spec.outage())
}

#[cfg(test)]
mod tests {
    use super::super::stream::testing::listed;
    use super::*;
    use crate::config::{Diagnostics, Document};
    use fusion_models::fault::derive_seed;

    fn faults(text: &str) -> Vec<(String, Box<dyn FaultSpec>)> {
        let (document, _) = Document::parse("filter.toml", text);
        let read = |entry: &crate::config::Entry| {
            let mut diagnostics = Diagnostics::new();
            let known = fusion_models::registry::names(fusion_models::registry::Role::Fault);
            let spec = entry.node.read_block::<dyn FaultSpec>("fault", &known, &mut diagnostics);
            (entry.key.clone(), spec.unwrap_or_else(|| panic!("{diagnostics}")))
        };
        document.root().entries().iter().map(read).collect()
    }

    fn ten() -> Box<dyn RowStream> {
        listed((0..10).map(|k| Ok((f64::from(k), 1.0))).collect())
    }

    fn run(text: &str, name: &str, seed: u64) -> (Vec<(f64, f64)>, SourceReport) {
        let seed_of = |fault: &str| derive_seed(seed, &[name, fault]);
        let mut source = Faulted::new(ten(), &faults(text), seed_of).unwrap();
        let (mut row, mut rows) = (Vec::new(), Vec::new());
        while let Some(stamp) = source.next(&mut row).unwrap() {
            rows.push((stamp.time.seconds().round(), row[0]));
        }
        (rows, source.report())
    }

    #[test]
    fn faults_are_applied_in_order_and_counted() {
        let text = "
            step = { type = 'bias_step', at = 8, value = [2] }
            tunnel = { type = 'outage', window = { from = 2, to = 7 } }";
        let (rows, report) = run(text, "wheel", 1);
        assert_eq!(rows, [(0.0, 1.0), (1.0, 1.0), (7.0, 1.0), (8.0, 3.0), (9.0, 3.0)]);
        let expected = "\
5 of 10 rows, 9.0 s at 0.444 Hz, longest gap 6.000 s at 1.000 s
  left out 5: withheld by fault tunnel
  disturbed 2: fault step";
        assert_eq!(report.to_string(), expected);
    }

    #[test]
    fn a_late_row_comes_after_newer_ones_and_at_the_end_of_the_log_at_the_latest() {
        let (rows, report) = run(
            "slow = { type = 'late', by = '2.5 s', window = [{ from = 3, to = 5 }, { from = 9 }] }",
            "wheel",
            1,
        );
        let stamps: Vec<f64> = rows.iter().map(|r| r.0).collect();
        assert_eq!(stamps, [0.0, 1.0, 2.0, 5.0, 3.0, 6.0, 4.0, 7.0, 8.0, 9.0]);
        assert_eq!((report.used, report.disturbed), (10, vec![("slow".to_owned(), 3)]));
    }

    #[test]
    fn copies_follow_their_row_and_carry_what_earlier_faults_did_to_it() {
        let text = "
            step = { type = 'bias_step', at = 2, value = [1] }
            twice = { type = 'duplicate', copies = 2, window = { from = 1, to = 3 } }
            slow = { type = 'late', by = 1, window = { from = 2, to = 3 } }";
        let (rows, report) = run(text, "wheel", 1);
        let expected = [
            (0.0, 1.0),
            (1.0, 1.0),
            (1.0, 1.0),
            (1.0, 1.0),
            (2.0, 2.0),
            (2.0, 2.0),
            (2.0, 2.0),
            (3.0, 2.0),
        ];
        assert_eq!(rows[..8], expected);
        // More rows may be delivered than were read.
        assert_eq!((report.rows, report.used), (10, 14));
    }

    #[test]
    fn a_wrong_clock_changes_the_stamp_and_not_the_arrival() {
        let faults = faults("clock = { type = 'clock_jump', by = '1 h', window = { from = 2, to = 4 } }");
        let mut source = Faulted::new(ten(), &faults, |_| 0).unwrap();
        let (mut row, mut seen) = (Vec::new(), Vec::new());
        while let Some(stamp) = source.next(&mut row).unwrap() {
            assert_eq!(source.disturbed().is_empty(), stamp.time == stamp.arrival);
            seen.push((stamp.time.seconds(), stamp.arrival.seconds()));
        }
        assert_eq!(seen[1..5], [(1.0, 1.0), (3602.0, 2.0), (3603.0, 3.0), (4.0, 4.0)]);
        // Other sources go on meanwhile, as they would live.
        let jumping = Faulted::new(ten(), &faults, |_| 0).unwrap();
        let mut merged = super::super::Merged::new(vec![Box::new(jumping), ten()]);
        let mut order = Vec::new();
        while let Some(row) = merged.next().unwrap() {
            order.push((row.stream, row.time.seconds()));
        }
        assert_eq!(order[4..8], [(0, 3602.0), (1, 2.0), (0, 3603.0), (1, 3.0)]);
    }

    #[test]
    fn randomness_depends_on_run_source_and_fault_and_on_no_other_fault() {
        let noise = "noise = { type = 'noise', sigma = 1 }";
        let (rows, _) = run(noise, "wheel", 1);
        assert_eq!(run(noise, "wheel", 1).0, rows);
        assert_ne!(run(noise, "wheel", 2).0, rows);
        assert_ne!(run(noise, "other", 1).0, rows);
        assert_ne!(run("hum = { type = 'noise', sigma = 1 }", "wheel", 1).0, rows);
        let (fewer, _) = run(&format!("gap = {{ type = 'outage', window = {{ to = 5 }} }}\n{noise}"), "wheel", 1);
        assert_eq!(fewer, rows[5..]);
    }

    #[test]
    fn outages_are_found_among_other_faults() {
        let faults = faults("a = { type = 'noise', sigma = 1 }\nb = { type = 'outage', window = { from = 3, duration = 2, every = 4 } }");
        let listed: Vec<bool> = outages(&faults).map(|w| w.contains(Time::from_seconds(8.5))).collect();
        assert_eq!(listed, [true]);
    }

    #[test]
    fn all_mistakes_of_the_faults_are_named_by_their_fields() {
        let text = "a = { type = 'noise', sigma = '1 deg' }\nb = { type = 'frozen', channel = 'x', window = { to = 1 } }";
        let errors = Faulted::new(ten(), &faults(text), |_| 0).unwrap_err();
        let fields: Vec<&str> = errors.iter().map(|e| e.field.as_str()).collect();
        assert_eq!(fields, ["fault.a.sigma", "fault.b.channel"]);
    }
}
