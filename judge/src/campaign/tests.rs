//! Runs that fail: a row each, with the reason.

use super::{Campaign, Outcome, Runner, read, seed_of, write};
use crate::part::{Head, Kind, Part, Parts, Subject};
use core::ops::Range;
use fusion::Selection;
use fusion::config::Diagnostics;
use fusion::design::Design;
use fusion::run::Options;
use fusion_core::time::Time;
use fusion_models::block::BuildError;
use fusion_models::fault::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use schemars::JsonSchema;
use serde::Deserialize;

/// A fault that cannot be built with about one seed of `one_in`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FailingSpec {
    one_in: u64,
}

fusion_models::register!(Fault, "failing", FailingSpec, "one_in = 3");

#[typetag::deserialize(name = "failing")]
impl FaultSpec for FailingSpec {
    fn windows(&self) -> Windows {
        Windows::default()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        match context.seed % self.one_in {
            0 => Err(BuildError::at("one_in", "an unlucky seed, \"unbuilt\"")),
            _ => Ok(Box::new(Harmless)),
        }
    }
}

#[derive(Debug)]
struct Harmless;

impl Fault for Harmless {
    fn columns(&self) -> Range<usize> {
        0..0
    }

    fn apply(&mut self, _: Time, _: &mut [f64]) -> RowOutcome {
        RowOutcome::Untouched
    }
}

const RUNS: u64 = 12;

fn design(one_in: Option<u64>) -> Design {
    let fault = one_in.map(|one_in| format!("simulation.sensor.velocity.fault.failing={{ type = \"failing\", one_in = {one_in} }}"));
    let set = ["run.stop=2".to_owned()].into_iter().chain(fault).collect();
    let selection = Selection {
        set,
        ..Selection::default()
    };
    selection.load("../configs/ins-gps.toml").unwrap_or_else(|d| panic!("{d}"))
}

/// The part of these numbers, and why all of them have failed.
fn part(designs: &[Design], numbers: Range<u64>) -> (Vec<u8>, Option<Diagnostics>) {
    let subjects = designs.iter().map(|design| Subject::new("", design, 1)).collect();
    let head = Head::new(Kind::Compare, subjects, numbers, None);
    let work: Vec<(&Design, Options)> = designs.iter().map(|design| (design, Options::default())).collect();
    let mut bytes = Vec::new();
    let runner = Runner::new(1, 2, false, &|_| {}).unwrap();
    let failed = runner.write(&work, &head, &mut bytes).unwrap();
    (bytes, failed)
}

fn parts(bytes: &[u8]) -> Parts {
    Parts::from(Part::in_memory("part", bytes.into()).unwrap())
}

fn outcomes(bytes: &[u8]) -> Vec<Vec<Outcome>> {
    let (_, (), rows) = parts(bytes).read().unwrap();
    rows
}

fn table(bytes: &[u8], campaign: &Campaign) -> Vec<Vec<String>> {
    let mut text = Vec::new();
    write(&parts(bytes), campaign, &mut text).unwrap();
    let rows = csv::ReaderBuilder::new().has_headers(false).from_reader(&*text).into_records();
    rows.map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
}

#[test]
fn a_failed_run_is_a_row_with_its_reason_and_the_others_are_as_without_it() {
    let (bytes, failed) = part(&[design(Some(3)), design(None)], 0..RUNS);
    assert!(failed.is_none(), "some runs have results");
    let campaigns = read(&parts(&bytes)).unwrap();
    let [some, all] = campaigns.as_slice() else { panic!("two designs") };
    assert_eq!((all.runs, all.failed), (RUNS as usize, 0));
    assert!(some.failed > 0 && some.runs > 0);
    assert_eq!(some.runs + some.failed, RUNS as usize);
    let (mine, others) = (table(&bytes, some), outcomes(&bytes));
    let failures: Vec<_> = others
        .iter()
        .filter_map(|row| match &row[0] {
            Outcome::Failed(run) => Some(run.clone()),
            Outcome::Ended(_) => None,
        })
        .collect();
    assert_eq!(some.failures(), failures);
    let width = mine[0].len();
    for (number, row) in others.iter().enumerate() {
        let cells = &mine[number + 1];
        assert_eq!((&*cells[0], cells.len()), (&*number.to_string(), width));
        match (&row[0], &row[1]) {
            (Outcome::Failed(run), Outcome::Ended(_)) => {
                assert_eq!(run.seed, seed_of(1, number as u64));
                assert!(run.reason.contains("an unlucky seed, \"unbuilt\""), "{}", run.reason);
                assert!(cells[2..width - 1].iter().all(String::is_empty));
                assert_eq!(cells[width - 1], run.reason);
            }
            // A row is a function of its seed: a design without the fault has the same one. Debug prints every digit.
            (Outcome::Ended(mine), Outcome::Ended(other)) => {
                assert_eq!(format!("{:?}", mine.blocks), format!("{:?}", other.blocks));
                assert_eq!(cells[width - 1], "");
            }
            wrong => panic!("{wrong:?}"),
        }
    }
    // Runs are compared by their seeds, also after a failed one.
    let duel = some.against(all, super::Compared::Position).unwrap();
    assert_eq!((duel.better, duel.worse, duel.runs), (0, 0, some.runs));
}

#[test]
fn parts_without_a_result_belong_to_the_whole() {
    let one = [design(Some(3))];
    let (whole, _) = part(&one, 0..RUNS);
    let split: Vec<Vec<u8>> = (0..RUNS).map(|number| part(&one, number..number + 1).0).collect();
    assert!(split.iter().any(|bytes| read(&parts(bytes)).unwrap()[0].first().is_none()));
    let opened = split.iter().map(|bytes| Part::in_memory("part", bytes.as_slice().into()).unwrap());
    let mut joined = Vec::new();
    Parts::whole(opened.collect()).unwrap().join(&mut joined).unwrap();
    let campaign = |bytes: &[u8]| read(&parts(bytes)).unwrap().remove(0);
    assert_eq!(table(&joined, &campaign(&joined)), table(&whole, &campaign(&whole)));
}

#[test]
fn if_all_runs_fail_the_first_mistake_is_returned_with_its_place() {
    let one = [design(Some(3))];
    let (whole, _) = part(&one, 0..RUNS);
    let number = read(&parts(&whole)).unwrap()[0].failures()[0].run;
    let (bytes, failed) = part(&one, number..number + 1);
    let told = failed.expect("no run has a result").to_string();
    assert!(told.contains("an unlucky seed") && told.contains("one_in = 3"), "{told}");
    let campaign = &read(&parts(&bytes)).unwrap()[0];
    assert_eq!((campaign.runs, campaign.failed), (0, 1));
    assert_eq!(table(&bytes, campaign).len(), 2);
}
