//! Rows that come late, used by going back: every shipped design, any order of arrival.

use super::real::real_design;
use fusion::Navigator;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::runner::{Discard, Event, Halt, Row};
use fusion::core::testing::Lcg;
use fusion::core::time::{Time, nanos};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use std::path::{Path, PathBuf};

/// How far back designs go here \[s\].
const HORIZON: f64 = 3.0;
const REWIND: [&str; 2] = ["run.order=\"rewind\"", "run.rewind={ horizon = \"3 s\", spacing = \"0.25 s\" }"];

/// A row as it was fed.
#[derive(Clone)]
pub struct Fed {
    pub stream: usize,
    pub time: Time,
    pub number: u64,
    pub values: Vec<f64>,
}

/// The rows of a run, up to a number.
struct Rows(Vec<Fed>, usize);

impl RunObserver for Rows {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Row(row) = event {
            if self.0.len() == self.1 {
                return Err("enough".into());
            }
            self.0.push(Fed {
                stream: row.stream,
                time: row.time,
                number: row.number,
                values: row.values.to_vec(),
            });
        }
        Ok(())
    }
}

/// The rows of a design, `most` at most.
pub fn rows(design: &Design, options: &Options, most: usize) -> Vec<Fed> {
    let mut rows = Rows(Vec::new(), most);
    // It stops where there are enough.
    let _ = Run::open(design, options)
        .unwrap_or_else(|d| panic!("{d}"))
        .go(&mut [&mut rows], &mut |_| {});
    rows.0
}

/// What is left of a run: the memory of the newest belief, and how much was told.
#[derive(Debug, PartialEq)]
pub struct End {
    pub time: Time,
    pub x: Vec<u64>,
    pub p: Vec<u64>,
    pub updates: usize,
    pub estimates: usize,
}

pub fn navigator(design: &Design) -> Navigator {
    Navigator::from_assembly(assemble(design, declared_streams(design).unwrap()).unwrap_or_else(|e| panic!("{e}")))
}

/// Feeds `rows` in this order to `nav`, to the end of the log where it `ends`.
pub fn feed(nav: &mut Navigator, rows: &[Fed], ends: bool, told: &mut dyn FnMut(&Event<'_>)) {
    let mut observer = |event: &Event<'_>| told(event);
    for row in rows {
        let fed = Row {
            number: row.number,
            ..Row::new(row.stream, row.time, &row.values)
        };
        nav.feed_row(&fed, &mut observer).unwrap_or_else(|e| panic!("{e}"));
    }
    if ends {
        nav.finish(&mut observer).unwrap();
    }
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|v| v.to_bits()).collect()
}

fn ended(design: &Design, rows: &[Fed]) -> (Option<End>, u64) {
    let mut nav = navigator(design);
    let (mut updates, mut estimates) = (0, 0);
    feed(&mut nav, rows, true, &mut |event| match event {
        Event::Updated { .. } => updates += 1,
        Event::Estimate { .. } => estimates += 1,
        Event::Discarded {
            why: Discard::Late { .. },
            consumer,
            time,
            ..
        } => panic!("{consumer} at {time} is late"),
        _ => {}
    });
    let end = nav.belief().map(|belief| End {
        time: belief.time,
        x: bits(&belief.x),
        p: bits(&belief.covariance.to_dense()),
        updates,
        estimates,
    });
    let count = nav.assembly().runner.rewinds().map_or(0, |r| r.count);
    (end, count)
}

/// Orders of arrival: by how much each row comes late \[ns\].
fn lateness(kind: usize, random: &mut Lcg, rows: &[Fed]) -> Vec<i64> {
    // Below the horizon.
    let most = 0.97 * HORIZON;
    let input = rows.iter().map(|r| r.stream).fold(vec![0_usize; 32], |mut n, s| {
        n[s] += 1;
        n
    });
    let densest = (0..input.len()).max_by_key(|s| input[*s]).unwrap();
    let burst: Vec<f64> = (0..32).map(|_| 0.2 + (most - 0.2) * random.unit()).collect();
    let late: Vec<f64> = (0..32).map(|_| 0.6 * most * random.unit()).collect();
    let each = rows.iter().map(|row| {
        let seconds = row.time.seconds();
        nanos(match kind {
            // Uniform.
            0 => most * random.unit(),
            // All of a stream at once, every so often.
            1 => burst[row.stream] - seconds.rem_euclid(burst[row.stream]),
            // Everything but the densest stream by two seconds or so, with jitter.
            2 if row.stream != densest => 0.6 * most + 0.4 * most * random.unit(),
            // Each stream by a time of its own, with jitter; some rows come at once.
            3 if random.unit() < 0.8 => late[row.stream] + 0.4 * most * random.unit(),
            // The input alone, by less than what is coasted through.
            4 if row.stream == densest => 0.09,
            _ => 0.0,
        })
    });
    each.collect()
}

pub fn shuffled(kind: usize, random: &mut Lcg, rows: &[Fed]) -> Vec<Fed> {
    let late = lateness(kind, random, rows);
    let mut order: Vec<usize> = (0..rows.len()).collect();
    // Rows of one stream and one stamp stay in order: nothing else tells them apart.
    order.sort_by_key(|&k| (rows[k].time.shifted(late[k]), k));
    order.into_iter().map(|k| rows[k].clone()).collect()
}

/// In time order, and in orders of arrival of every kind: the same to the last bit, held back or rewound.
fn obeys(name: &str, read: impl Fn(&[&str]) -> (Design, Options), most: usize) {
    let (rewinding, options) = read(&REWIND);
    let (holding, _) = read(&["run.reorder=\"3 s\""]);
    // Longer where the filter starts later.
    let starts = [1, 4, 16].map(|times| times * most).into_iter().find_map(|most| {
        let rows = rows(&rewinding, &options, most);
        let (wanted, _) = ended(&holding, &rows);
        wanted.is_some_and(|end| end.updates > 0).then_some(rows)
    });
    let rows = starts.unwrap_or_else(|| panic!("{name} uses no measurement"));
    let (wanted, _) = ended(&holding, &rows);
    let mut random = Lcg::new(rows.len() as u64);
    let (in_order, _) = ended(&rewinding, &rows);
    assert_eq!(in_order, wanted, "{name}: rewinding, in order of time");
    for kind in 0..5 {
        let late = shuffled(kind, &mut random, &rows);
        assert_eq!(ended(&holding, &late).0, wanted, "{name}: held back, order {kind}");
        let (end, rewinds) = ended(&rewinding, &late);
        assert_eq!(end, wanted, "{name}: rewinding, order {kind}");
        let alone = rows.iter().all(|row| row.stream == rows[0].stream);
        // Of an input that is a little late, no other row need have come meanwhile.
        assert!(rewinds > 0 || alone || kind == 4, "{name}: order {kind} never goes back");
    }
}

pub fn designs(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

/// A shipped design with overrides.
pub fn shipped(file: &Path, sets: &[&str]) -> (Design, Options) {
    let mut document = Document::load(file).unwrap_or_else(|d| panic!("{d}"));
    sets.iter().for_each(|set| document.set(set).unwrap());
    let design = Design::read(document).unwrap_or_else(|d| panic!("{}: {d}", file.display()));
    (design, Options::default())
}

#[test]
fn every_simulated_design_ends_as_in_time_order_whatever_the_order_of_arrival() {
    let mut count = 0;
    for folder in ["configs", "configs/backends", "configs/published"] {
        for file in designs(folder) {
            obeys(&file.display().to_string(), |sets| shipped(&file, sets), 4000);
            count += 1;
        }
    }
    assert!(count >= 7, "{count}");
}

#[test]
fn every_backend_ends_as_in_time_order_whatever_the_order_of_arrival() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    for backend in ["ekf", "iekf", "ukf", "invariant", "error_state+udu", "error_state+square_root"] {
        let table = fusion::design::FilterSpec::table_of(backend).unwrap();
        let read = |sets: &[&str]| shipped(&file, &[sets, &[&table]].concat());
        obeys(backend, read, 1500);
    }
}

/// Estimated offsets look at the input after them: where that comes later it has to be looked at, too.
#[test]
fn what_has_been_looked_at_is_looked_at_again() {
    let read = |sets: &[&str]| {
        let (mut document, _) = Document::parse("order.toml", super::order::DESIGN);
        sets.iter().for_each(|set| document.set(set).unwrap());
        (Design::read(document).unwrap_or_else(|d| panic!("{d}")), Options::default())
    };
    obeys("offsets and leaders", read, 2500);
}

#[test]
fn every_recorded_design_ends_as_in_time_order_whatever_the_order_of_arrival() {
    for file in designs("configs/real") {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        if real_design(&name, &[], &[]).is_none() {
            return;
        }
        obeys(&name, |sets| real_design(&name, &[], sets).unwrap(), 5000);
    }
}

#[test]
fn a_row_beyond_the_horizon_is_told_and_not_used() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let (design, options) = shipped(&file, &REWIND);
    let mut rows = rows(&design, &options, 3000);
    let (wanted, _) = ended(&design, &rows);
    let gnss = rows
        .iter()
        .rposition(|row| row.stream != rows[0].stream && row.values != rows[0].values)
        .unwrap();
    let mut stray = rows[gnss / 2..].iter().find(|row| row.stream == rows[gnss].stream).unwrap().clone();
    stray.values.iter_mut().for_each(|v| *v += 1e-4);
    rows.push(stray);
    let (mut nav, mut late) = (navigator(&design), 0);
    feed(&mut nav, &rows, true, &mut |event| {
        late += usize::from(matches!(
            event,
            Event::Discarded {
                why: Discard::Late { .. },
                ..
            }
        ));
    });
    assert!(late > 0);
    assert_eq!(bits(&nav.belief().unwrap().x), wanted.unwrap().x);
}

#[test]
fn the_newest_estimate_is_told_as_soon_as_its_row_is_there() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let (design, options) = shipped(&file, &REWIND);
    let rows = rows(&design, &options, 3000);
    let (mut nav, mut current, mut last) = (navigator(&design), 0, Time::MIN);
    for row in &rows {
        feed(&mut nav, core::slice::from_ref(row), false, &mut |event| {
            if let Event::Current { belief } = event {
                assert_eq!(belief.time, row.time);
                assert!(belief.time > last);
                (current, last) = (current + 1, belief.time);
            }
        });
    }
    assert!(current > 1000, "{current}");
}

#[test]
fn snapshots_of_fifteen_states_are_quick() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let (design, options) = shipped(&file, &["run.order=\"hold\""]);
    let rows = rows(&design, &options, 3000);
    let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap();
    let (n, mut runner) = (assembly.layout.dim(), assembly.runner);
    for row in &rows {
        let fed = Row::new(row.stream, row.time, &row.values);
        runner.feed(&fed, &mut |_: &Event<'_>| ()).unwrap();
    }
    let mut bytes = Vec::new();
    let best = (0..10).map(|_| {
        let begun = std::time::Instant::now();
        for _ in 0..1000 {
            bytes.clear();
            fusion::core::memory::save(&mut runner, &mut bytes);
        }
        begun.elapsed().as_secs_f64() * 1e-3
    });
    let best = best.fold(f64::MAX, f64::min);
    eprintln!("{n} states: {} bytes in {:.0} ns", bytes.len(), best * 1e9);
    // Ten thousand a second at a tenth of the time; 1 us is what it takes on an idle machine.
    assert!(best < 1e-5, "{best} s");
}
