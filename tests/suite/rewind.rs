//! Rows that arrive late, used by going back: every shipped design, any order of arrival.

use super::real::real_design;
use super::support::Workspace;
use fusion::Navigator;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::gate::Mode;
use fusion::core::runner::{Discard, Event, Halt, Row};
use fusion::core::testing::Lcg;
use fusion::core::time::{Time, nanos};
use fusion::design::Design;
use fusion::observe::{RunEvent, RunObserver};
use fusion::run::{Options, Run};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The horizon of the designs here \[s\].
const HORIZON: f64 = 3.0;
const REWIND: [&str; 2] = ["run.order=\"rewind\"", "run.rewind={ horizon = \"3 s\", spacing = \"0.25 s\" }"];

/// A row as fed to the navigator.
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

/// The rows of a design, at most `most`.
pub fn rows(design: &Design, options: &Options, most: usize) -> Vec<Fed> {
    let mut rows = Rows(Vec::new(), most);
    // It stops when there are enough rows.
    let _ = Run::open(design, options)
        .unwrap_or_else(|d| panic!("{d}"))
        .go(&mut [&mut rows], &mut |_| {});
    rows.0
}

/// The result of a run: the memory of the newest belief, and the number of events.
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

/// Feeds `rows` in this order to `nav`, and ends the log if `ends`.
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

/// Orders of arrival: the delay of each row \[ns\].
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
            // All rows of a stream at once, from time to time.
            1 => burst[row.stream] - seconds.rem_euclid(burst[row.stream]),
            // All streams except the densest, by about two seconds, with jitter.
            2 if row.stream != densest => 0.6 * most + 0.4 * most * random.unit(),
            // Each stream with its own delay, with jitter. Some rows arrive at once.
            3 if random.unit() < 0.8 => late[row.stream] + 0.4 * most * random.unit(),
            // Only the input, by less than the duration that coasting covers.
            4 if row.stream == densest => 0.09,
            _ => 0.0,
        })
    });
    each.collect()
}

pub fn shuffled(kind: usize, random: &mut Lcg, rows: &[Fed]) -> Vec<Fed> {
    // Rows of one stream with one stamp, as of satellites, stay in order: no other property distinguishes them.
    let mut delays = HashMap::new();
    let late = lateness(kind, random, rows).into_iter().zip(rows);
    let late: Vec<i64> = late
        .map(|(delay, row)| *delays.entry((row.stream, row.time)).or_insert(delay))
        .collect();
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by_key(|&k| (rows[k].time.shifted(late[k]), k));
    order.into_iter().map(|k| rows[k].clone()).collect()
}

/// All orders of arrival.
const ORDERS: [usize; 5] = [0, 1, 2, 3, 4];

/// The orders for a shipped design: each order has several designs. Kernels, backends and gates have all orders.
const fn two_orders(design: usize) -> [usize; 2] {
    [design % 5, (design + 1 + design / 5 % 4) % 5]
}

/// In time order, and in these orders of arrival: the same to the last bit, held back or rewound.
fn obeys(name: &str, read: impl Fn(&[&str]) -> (Design, Options), most: usize, orders: &[usize]) {
    let (rewinding, options) = read(&REWIND);
    let (holding, _) = read(&["run.reorder=\"3 s\""]);
    // Longer if the filter starts later.
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
    for &kind in orders {
        let late = shuffled(kind, &mut random, &rows);
        assert_eq!(ended(&holding, &late).0, wanted, "{name}: held back, order {kind}");
        let (end, rewinds) = ended(&rewinding, &late);
        assert_eq!(end, wanted, "{name}: rewinding, order {kind}");
        let alone = rows.iter().all(|row| row.stream == rows[0].stream);
        // If the input is only a little late, no other row need arrive in between.
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
fn every_kernel_ends_as_in_time_order_whatever_the_order_of_arrival() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    for kernel in fusion::core::covariance::Kernel::here() {
        let read = |sets: &[&str]| {
            let (mut design, options) = shipped(&file, sets);
            design.set_kernel(kernel);
            (design, options)
        };
        obeys(kernel.name(), read, 1500, &ORDERS);
    }
}

#[test]
fn every_simulated_design_ends_as_in_time_order_whatever_the_order_of_arrival() {
    let mut count = 0;
    for folder in ["configs", "configs/backends", "configs/published"] {
        for file in designs(folder) {
            obeys(&file.display().to_string(), |sets| shipped(&file, sets), 4000, &two_orders(count));
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
        obeys(backend, read, 1500, &ORDERS);
    }
}

/// Estimated offsets, leaders, stages and initialisers.
fn offsets_and_leaders(sets: &[&str]) -> (Design, Options) {
    with(super::order::DESIGN, sets)
}

/// The same, started without standstill: by a fix and an attitude with a large σ.
fn starting_anywhere(sets: &[&str]) -> (Design, Options) {
    let (before, rest) = super::order::DESIGN.split_once("[initial.level]").unwrap();
    let (_, fix) = rest.split_once("[initial.fix]").unwrap();
    let (fix, rest) = fix.split_once("[initial.heading]").unwrap();
    let (_, world) = rest.split_once("[simulation]").unwrap();
    let start = "[initial.level]\ntype = \"explicit\"\nattitude = [0, 0, 0]\nattitude_sigma = \"30 deg\"\n";
    with(&format!("{before}{start}[initial.fix]{fix}[simulation]{world}"), sets)
}

fn with(text: &str, sets: &[&str]) -> (Design, Options) {
    let (mut document, _) = Document::parse("order.toml", text);
    sets.iter().for_each(|set| document.set(set).unwrap());
    (Design::read(document).unwrap_or_else(|d| panic!("{d}")), Options::default())
}

/// Estimated offsets use the input after them: if this input arrives later, it must be used too.
#[test]
fn what_has_been_looked_at_is_looked_at_again() {
    obeys("offsets and leaders", offsets_and_leaders, 2500, &ORDERS);
}

/// Faults of the instruments: gaps with coasting, one gap after which the filter starts again, spikes, an instrument
/// that freezes, single wrong fixes and a series of wrong fixes.
const TROUBLE: [&str; 7] = [
    "process.input.longest_gap=\"1.2 s\"",
    "simulation.imu.fault.gap={ type = \"outage\", window = { from = \"7 s\", duration = \"0.4 s\", every = \"2.9 s\" } }",
    "simulation.imu.fault.long={ type = \"outage\", window = { from = \"12 s\", duration = \"1.5 s\" } }",
    "simulation.imu.fault.spike={ type = \"spike\", channel = \"angular_rate\", value = [9, 0, 0], window = { from = \"8.501 s\", duration = \"0.01 s\" } }",
    "simulation.imu.fault.frozen={ type = \"frozen\", window = { from = \"15 s\", duration = \"0.3 s\" } }",
    "simulation.sensor.position.fault.outliers={ type = \"outliers\", rate = 0.05, size = [\"10 m\", \"30 m\"] }",
    "simulation.sensor.position.fault.track={ type = \"spike\", channel = \"position\", value = [40, 0, 0], window = { from = \"9 s\", duration = \"2.8 s\" } }",
];
/// Every gate, with limits so low that it denies, resumes and re-acquires.
const GATES: [(&str, &[&str]); 4] = [
    ("none", &["sensor.position.gate={ type = \"none\" }"]),
    (
        "nis",
        &[
            "sensor.position.gate={ type = \"nis\", probability = 0.99, recovery = { deny_after = 2, resume_after = 2, reacquire_after = \"0.5 s\" } }",
        ],
    ),
    (
        "two_condition",
        &[
            "sensor.position.gate={ type = \"two_condition\", probability = 0.95, recovery = { deny_after = 2, resume_after = 2, reacquire_after = \"0.5 s\" } }",
        ],
    ),
    (
        "hypotheses",
        &[
            "sensor.position.gate={ type = \"hypotheses\", false_rate = 0.1, false_ends = 0.2, reach = \"100 m\" }",
            "filter.bank={ hypotheses = 6 }",
        ],
    ),
];

/// A design for each gate, with trouble.
pub fn troubled() -> impl Iterator<Item = (&'static str, impl Fn(&[&str]) -> (Design, Options))> {
    GATES
        .into_iter()
        .map(|(gate, own)| (gate, move |sets: &[&str]| starting_anywhere(&[&TROUBLE, own, sets].concat())))
}

#[test]
fn every_gate_ends_as_in_time_order_through_gaps_and_outliers() {
    for (gate, read) in troubled() {
        let (design, options) = read(&[]);
        let (mut starts, mut denied, mut resumed, mut was_denied) = (0, 0, 0, false);
        feed(
            &mut navigator(&design),
            &rows(&design, &options, 2200),
            true,
            &mut |event| match event {
                Event::Started { .. } => starts += 1,
                Event::Updated { sensor: 0, update, .. } => {
                    let is_denied = update.mode == Mode::Denied;
                    denied += usize::from(is_denied);
                    resumed += usize::from(was_denied && !is_denied);
                    was_denied = is_denied;
                }
                _ => {}
            },
        );
        assert!(starts >= 2, "{gate}: {starts} starts");
        let has_modes = !["none", "hypotheses"].contains(&gate);
        assert!(
            !has_modes || denied > 5 && resumed > 0,
            "{gate}: {denied} denied, {resumed} resumed"
        );
        obeys(gate, read, 2200, &ORDERS);
    }
}

#[test]
fn every_recorded_design_ends_as_in_time_order_whatever_the_order_of_arrival() {
    for (number, file) in designs("configs/real").into_iter().enumerate() {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        if real_design(&name, &[], &[]).is_none() {
            return;
        }
        obeys(&name, |sets| real_design(&name, &[], sets).unwrap(), 3000, &two_orders(number));
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
    // Ten thousand per second at a tenth of the time; an idle machine takes 1 us.
    assert!(best < 1e-5, "{best} s");
}

#[test]
fn what_was_believed_at_the_time_and_what_later_rows_made_of_it_have_a_file_each() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/ins-gps.toml");
    let late = "simulation.sensor.position.fault.late={ type = \"late\", by = \"2 s\" }";
    let (design, options) = shipped(&file, &[&REWIND[..], &[late, "run.output_rate=5"]].concat());
    let w = Workspace::new("causal");
    let folders = [("other", false), ("causal", true)].map(|(out, causal)| {
        let out = w.path(out);
        let options = Options {
            out: Some(out.clone()),
            causal,
            base: options.base.clone(),
            ..Options::default()
        };
        fusion::run::run(&design, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{d}"));
        out
    });
    let read = |folder: usize, name: &str| std::fs::read_to_string(folders[folder].join(name)).unwrap();
    let [revised, current] = ["estimates.csv", "current.csv"].map(|name| read(0, name));
    assert!(read(1, "revised.csv") == revised && read(1, "estimates.csv") == current);
    assert!(!folders[0].join("revised.csv").exists() && !folders[1].join("current.csv").exists());
    assert!(revised != current, "fixes 2 s late change what was believed");
    assert_eq!(revised.lines().count(), current.lines().count());
}
