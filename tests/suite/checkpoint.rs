//! Stops at any row and resumes from a checkpoint: the same results as without a stop.

use super::real::real_design;
use super::rewind::{Fed, designs, feed, navigator, rows, shipped, shuffled, troubled};
use fusion::CheckpointError;
use fusion::Navigator;
use fusion::core::belief::Belief;
use fusion::core::memory::save;
use fusion::core::runner::Event;
use fusion::core::testing::Lcg;
use fusion::design::Design;
use fusion::run::Options;
use std::path::Path;

/// The number of events, and a hash of all their bits.
#[derive(Debug, Default, PartialEq)]
struct Told(u64, u64);

impl Told {
    fn hear(&mut self, event: &Event<'_>) {
        self.0 += 1;
        match event {
            // Nine of ten events: their texts would take longer than the filter.
            Event::Estimate { belief } | Event::Current { belief } => {
                let mut bytes = vec![u8::from(matches!(event, Event::Current { .. }))];
                save(&mut Belief::clone(belief), &mut bytes);
                self.add(&bytes);
            }
            other => self.add(format!("{other:?}").as_bytes()),
        }
    }

    /// FNV-1a, by words of eight bytes.
    fn add(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let word = word.iter().fold(word.len() as u64, |all, byte| all << 8 | u64::from(*byte));
            self.1 = (self.1 ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
        }
    }
}

/// Feeds `rows` to the end and records the events. Returns them with the final memory.
fn end(nav: &mut Navigator, rows: &[Fed]) -> (Told, Vec<u8>) {
    let mut told = Told::default();
    feed(nav, rows, true, &mut |event| told.hear(event));
    (told, nav.checkpoint())
}

/// Stops at three rows, resumes in a newly assembled navigator, and compares all events and the memory with a run
/// without a stop.
fn resumes(name: &str, design: &Design, rows: &[Fed]) {
    let mut random = Lcg::new(rows.len() as u64);
    for _ in 0..3 {
        let at = (random.unit() * rows.len() as f64) as usize;
        let mut whole = navigator(design);
        feed(&mut whole, &rows[..at], false, &mut |_| ());
        let checkpoint = whole.checkpoint();
        let mut resumed = navigator(design);
        resumed.restore(&checkpoint).unwrap();
        assert_eq!(resumed.checkpoint(), checkpoint, "{name}: the checkpoint of row {at}, restored");
        let ends = [&mut whole, &mut resumed].map(|nav| end(nav, &rows[at..]));
        assert!(ends[0] == ends[1], "{name}: stopped at row {at}: {:?} {:?}", ends[0].0, ends[1].0);
    }
}

/// In order of time, and with rewinding and late streams.
fn obeys(name: &str, read: impl Fn(&[&str]) -> (Design, Options), most: usize) {
    let (holding, options) = read(&["run.reorder=\"0.5 s\""]);
    let rows = rows(&holding, &options, most);
    resumes(name, &holding, &rows);
    let (rewinding, _) = read(&["run.order=\"rewind\"", "run.rewind={ horizon = \"3 s\", spacing = \"0.25 s\" }"]);
    resumes(name, &rewinding, &shuffled(2, &mut Lcg::new(3), &rows));
}

#[test]
fn every_simulated_design_goes_on_from_a_checkpoint_as_without_a_stop() {
    for folder in ["configs", "configs/backends", "configs/published"] {
        for file in designs(folder) {
            obeys(&file.display().to_string(), |sets| shipped(&file, sets), 3000);
        }
    }
}

#[test]
fn every_recorded_design_goes_on_from_a_checkpoint_as_without_a_stop() {
    for file in designs("configs/real") {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        if real_design(&name, &[], &[]).is_none() {
            return;
        }
        obeys(&name, |sets| real_design(&name, &[], sets).unwrap(), 2500);
    }
}

#[test]
fn every_backend_goes_on_from_a_checkpoint_as_without_a_stop() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    for backend in ["ekf", "iekf", "ukf", "invariant", "error_state+udu", "error_state+square_root"] {
        let table = fusion::design::FilterSpec::table_of(backend).unwrap();
        obeys(backend, |sets| shipped(&file, &[sets, &[&table]].concat()), 1500);
    }
}

#[test]
fn every_gate_goes_on_from_a_checkpoint_through_gaps_and_outliers() {
    for (gate, read) in troubled() {
        obeys(gate, read, 2200);
    }
}

#[test]
fn a_checkpoint_of_another_design_or_half_of_one_is_refused_and_changes_nothing() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let (design, options) = shipped(&file, &[]);
    let (other, _) = shipped(&file, &["process.gyro.noise=\"1 deg/sqrt(h)\""]);
    let rows = rows(&design, &options, 500);
    let mut nav = navigator(&design);
    feed(&mut nav, &rows[..300], false, &mut |_| ());
    let checkpoint = nav.checkpoint();
    assert_eq!(navigator(&other).restore(&checkpoint), Err(CheckpointError::Design));
    feed(&mut nav, &rows[300..], false, &mut |_| ());
    let now = nav.checkpoint();
    for end in (0..checkpoint.len()).step_by(37) {
        nav.restore(&checkpoint[..end]).unwrap_err();
    }
    assert_eq!(nav.checkpoint(), now);
    nav.restore(&checkpoint).unwrap();
    assert_eq!(nav.checkpoint(), checkpoint, "back to row 300");
}

#[test]
fn every_kernel_goes_on_from_a_checkpoint_as_without_a_stop() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    for kernel in fusion::core::covariance::Kernel::here() {
        let read = |sets: &[&str]| {
            let (mut design, options) = shipped(&file, sets);
            design.set_kernel(kernel);
            (design, options)
        };
        obeys(kernel.name(), read, 1500);
    }
}
