//! Rows through declared faults, applied in the order in which they are declared.

use super::{ProvidedChannel, RowCounts, RowStream, SourceError, SourceReport, Stamp};
use core::ops::Range;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use fusion_models::fault::{Fault, FaultContext, FaultSpec, Outcome, Windows};

/// Faults as declared, by name.
type Declared = [(String, Box<dyn FaultSpec>)];

/// The faults at work on one stream, recorded or simulated, and what they did to it.
#[derive(Debug, Default)]
pub(crate) struct FaultChain {
    faults: Vec<(String, Box<dyn Fault>)>,
    disturbed: Vec<Range<usize>>,
    counts: RowCounts,
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

    /// Sends a row through the faults; returns whether it arrives. Those after the one that
    /// withholds it do not see it.
    pub(crate) fn pass(&mut self, time: Time, values: &mut [f64]) -> bool {
        self.disturbed.clear();
        for (name, fault) in &mut self.faults {
            match fault.apply(time, values) {
                Outcome::Untouched => {}
                Outcome::Disturbed => {
                    self.disturbed.push(fault.columns());
                    self.counts.disturbed(name);
                }
                Outcome::Withheld => {
                    self.counts.skipped(&format!("withheld by fault {name}"), None);
                    return false;
                }
            }
        }
        self.counts.used(time);
        true
    }

    /// The numbers of the last row that were disturbed.
    pub(crate) fn disturbed(&self) -> &[Range<usize>] {
        &self.disturbed
    }

    /// The numbers that its faults may disturb.
    pub(crate) fn disturbable(&self) -> impl Iterator<Item = Range<usize>> {
        self.faults.iter().map(|(_, fault)| fault.columns()).filter(|c| !c.is_empty())
    }

    /// What the faults did, added to the report of the rows that went in.
    pub(crate) fn report(&self, before: SourceReport) -> SourceReport {
        let own = self.counts.report();
        SourceReport {
            rows: before.rows,
            skipped: before.skipped.into_iter().chain(own.skipped).collect(),
            disturbed: before.disturbed.into_iter().chain(own.disturbed).collect(),
            ..own
        }
    }
}

/// A stream whose rows go through faults.
#[derive(Debug)]
pub struct Faulted {
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
        while let Some(stamp) = self.inner.next(values)? {
            if self.faults.pass(stamp.time, values) {
                return Ok(Some(stamp));
            }
        }
        Ok(None)
    }

    fn disturbed(&self) -> &[Range<usize>] {
        self.faults.disturbed()
    }

    fn disturbable(&self) -> Vec<Range<usize>> {
        self.faults.disturbable().collect()
    }

    /// Rows, stamps and gaps as delivered; what the source itself left out comes first.
    fn report(&self) -> SourceReport {
        self.faults.report(self.inner.report())
    }
}

/// The declared outages among faults, by the fault's name: for the drift per outage.
fn outages(declared: &Declared) -> impl Iterator<Item = (&str, &Windows)> {
    declared.iter().filter_map(|(name, spec)| Some((name.as_str(), spec.outage()?)))
}

/// The windows of the declared outages of some streams up to `end`, in order, each once.
pub(crate) fn outage_windows<'a>(declared: impl IntoIterator<Item = &'a Declared>, end: Time) -> Vec<(Time, Time)> {
    let all = declared.into_iter().flat_map(outages);
    let windows = all.flat_map(|(_, windows)| windows.within(Time::default(), end));
    let mut found: Vec<(Time, Time)> = windows.map(|w| (w.from, w.to)).collect();
    found.sort_unstable();
    found.dedup();
    found
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
            let known = ["outage", "noise", "bias_step", "outliers", "drop", "frozen", "spike"];
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
    fn declared_outages_can_be_listed() {
        let faults = faults("a = { type = 'noise', sigma = 1 }\nb = { type = 'outage', window = { from = 3, duration = 2, every = 4 } }");
        let listed: Vec<(&str, usize)> = outages(&faults)
            .map(|(name, windows)| (name, windows.within(Time::default(), Time::from_seconds(10.0)).len()))
            .collect();
        assert_eq!(listed, [("b", 2)]);
    }

    #[test]
    fn all_mistakes_of_the_faults_are_named_by_their_fields() {
        let text = "a = { type = 'noise', sigma = '1 deg' }\nb = { type = 'frozen', channel = 'x', window = { to = 1 } }";
        let errors = Faulted::new(ten(), &faults(text), |_| 0).unwrap_err();
        let fields: Vec<&str> = errors.iter().map(|e| e.field.as_str()).collect();
        assert_eq!(fields, ["fault.a.sigma", "fault.b.channel"]);
    }
}
