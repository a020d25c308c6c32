//! A source with its declared faults, applied in the order in which they are declared.

use super::report::Tally;
use super::{OpenContext, ProvidedChannel, Source, SourceError, SourceReport};
use core::ops::Range;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use fusion_models::fault::{Fault, FaultContext, FaultSpec, Outcome, Windows};

/// Faults at work on one source, in the order in which they are declared.
#[derive(Debug, Default)]
pub(crate) struct Chain {
    faults: Vec<(String, Box<dyn Fault>)>,
    disturbed: Vec<Range<usize>>,
}

impl Chain {
    /// Adds a fault after the others.
    pub(crate) fn push(&mut self, name: &str, fault: Box<dyn Fault>) {
        self.faults.push((name.to_owned(), fault));
    }

    /// Sends a row through the faults and tells the name of each that disturbs it. Returns the
    /// name of the one that withholds it, if any: those after it do not see the row.
    pub(crate) fn apply(&mut self, time: Time, row: &mut [f64], mut disturbs: impl FnMut(&str)) -> Option<&str> {
        self.disturbed.clear();
        for (name, fault) in &mut self.faults {
            match fault.apply(time, row) {
                Outcome::Untouched => {}
                Outcome::Disturbed => {
                    self.disturbed.push(fault.columns());
                    disturbs(name);
                }
                Outcome::Withheld => return Some(name.as_str()),
            }
        }
        None
    }

    /// The numbers of the last row that were disturbed.
    pub(crate) fn disturbed(&self) -> &[Range<usize>] {
        &self.disturbed
    }

    /// The numbers that its faults may disturb.
    pub(crate) fn disturbable(&self) -> impl Iterator<Item = Range<usize>> {
        self.faults.iter().map(|(_, fault)| fault.columns()).filter(|c| !c.is_empty())
    }
}

/// A source whose rows go through faults.
#[derive(Debug)]
pub struct Faulted {
    source: Box<dyn Source>,
    faults: Chain,
    tally: Tally,
}

impl Faulted {
    /// `source` with the faults declared by it, by name.
    ///
    /// # Errors
    /// All mistakes of the faults, the fields named `fault.<name>.<field>`.
    pub fn new(source: Box<dyn Source>, declared: &[(String, Box<dyn FaultSpec>)], context: &OpenContext) -> Result<Self, Vec<BuildError>> {
        let (mut faults, mut errors) = (Chain::default(), Vec::new());
        for (name, spec) in declared {
            let seed = context.seed_of(&format!("fault.{name}"));
            match spec.build(&FaultContext {
                channels: source.channels(),
                seed,
            }) {
                Ok(fault) => faults.push(name, fault),
                Err(error) => {
                    let dot = if error.field.is_empty() { "" } else { "." };
                    errors.push(BuildError {
                        field: format!("fault.{name}{dot}{}", error.field),
                        ..error
                    });
                }
            }
        }
        if errors.is_empty() {
            Ok(Self {
                source,
                faults,
                tally: Tally::default(),
            })
        } else {
            Err(errors)
        }
    }
}

impl Source for Faulted {
    fn channels(&self) -> &[ProvidedChannel] {
        self.source.channels()
    }

    fn next(&mut self, row: &mut Vec<f64>) -> Result<Option<Time>, SourceError> {
        while let Some(time) = self.source.next(row)? {
            let tally = &mut self.tally;
            match self.faults.apply(time, row, |name| tally.disturbed(name)) {
                Some(name) => self.tally.skipped(&format!("withheld by fault {name}"), None),
                None => {
                    self.tally.used(time);
                    return Ok(Some(time));
                }
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
        let (inner, own) = (self.source.report(), self.tally.report());
        SourceReport {
            rows: inner.rows,
            skipped: inner.skipped.into_iter().chain(own.skipped).collect(),
            disturbed: inner.disturbed.into_iter().chain(own.disturbed).collect(),
            ..own
        }
    }
}

/// The declared outages among faults, by the fault's name: for the drift per outage.
pub fn outages(declared: &[(String, Box<dyn FaultSpec>)]) -> impl Iterator<Item = (&str, &Windows)> {
    declared.iter().filter_map(|(name, spec)| Some((name.as_str(), spec.outage()?)))
}

#[cfg(test)]
mod tests {
    use super::super::testing::listed;
    use super::*;
    use crate::config::{Diagnostics, Document};

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

    fn ten() -> Box<dyn Source> {
        listed((0..10).map(|k| Ok((f64::from(k), 1.0))).collect())
    }

    fn run(text: &str, name: &str, seed: u64) -> (Vec<(f64, f64)>, SourceReport) {
        let context = OpenContext {
            name: name.to_owned(),
            seed,
            ..OpenContext::default()
        };
        let mut source = Faulted::new(ten(), &faults(text), &context).unwrap();
        let (mut row, mut rows) = (Vec::new(), Vec::new());
        while let Some(time) = source.next(&mut row).unwrap() {
            rows.push((time.seconds().round(), row[0]));
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
        let errors = Faulted::new(ten(), &faults(text), &OpenContext::default()).unwrap_err();
        let fields: Vec<&str> = errors.iter().map(|e| e.field.as_str()).collect();
        assert_eq!(fields, ["fault.a.sigma", "fault.b.channel"]);
    }
}
