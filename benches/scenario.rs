//! Whole runs over a real log: a car, MEMS IMU at 100 Hz, 26 states.
//!
//! `filter`  rows in memory, fed through the runner: reordering, stages, estimator
//! `run`     from compressed text to the score, as `fusion run` does it
//!
//! The log is in `$FUSION_DATA`, or in `../shared/data` next to the checkout. The figures of a whole process over a
//! simulated log come first: `scenario/process.rs`.

#![expect(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "measure/once.rs"]
mod once;
#[path = "scenario/process.rs"]
mod process;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::runner::{self, Event};
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::rows::{Merged, RowStream};
use fusion::run::{Options, run};
use fusion::source::OpenContext;
use std::path::{Path, PathBuf};
use std::time::Duration;

const DESIGN: &str = "configs/real/pntos-car.toml";
const LOG: &str = "pntos_cobra_car/derived/imu.csv.gz";

/// A stream, a stamp, and a row.
type Row = (usize, Time, Vec<f64>);

fn data() -> PathBuf {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    std::env::var_os("FUSION_DATA").map_or_else(beside, PathBuf::from)
}

fn design() -> Design {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(DESIGN);
    let document = Document::load(&file).expect("the design is in the repository");
    Design::read(document).expect("the design is sound")
}

/// The rows that the run feeds, in their order.
fn rows(design: &Design) -> Vec<Row> {
    let runner = assemble(design, declared_streams(design).unwrap()).unwrap().runner;
    let reference = design.reference.as_ref().map(|r| &r.block.source);
    let mut sources: Vec<Box<dyn RowStream>> = Vec::new();
    let mut streams = Vec::new();
    for named in design.sources.iter().filter(|s| !reference.is_some_and(|r| r.has(&s.name))) {
        let origin = design.run.origin.map(Into::into);
        let context = OpenContext {
            data_dir: data(),
            name: named.name.clone(),
            origin,
            seed: design.run.seed,
            ..OpenContext::default()
        };
        sources.push(named.block.source.open(&context).expect("the log is there"));
        streams.push(runner.stream(&named.name).expect("a source is a stream"));
    }
    let mut merged = Merged::new(sources);
    let start = design.run.start.map_or(Time::MIN, |t| Time::from_seconds(t.si()));
    let mut rows = Vec::new();
    while let Some(row) = merged.next().unwrap() {
        if row.time >= start {
            rows.push((streams[row.stream], row.time, row.values.to_vec()));
        }
    }
    rows
}

/// Feeds all rows to a new filter and counts the epochs.
fn feed(design: &Design, rows: &[Row]) -> u64 {
    let mut runner = assemble(design, declared_streams(design).unwrap()).unwrap().runner;
    let mut epochs = 0;
    let mut count = |event: &Event<'_>| epochs += u64::from(matches!(event, Event::Estimate { .. }));
    for (stream, time, row) in rows {
        runner.feed(&runner::Row::new(*stream, *time, row), &mut count).unwrap();
    }
    runner.finish(&mut count).unwrap();
    assert!(runner.belief().is_sound());
    epochs
}

fn whole_process(_: &mut Criterion) {
    process::figures();
}

fn benches(c: &mut Criterion) {
    if !data().join(LOG).exists() {
        println!("scenario/pntos: skipped, no {LOG} in {}; set FUSION_DATA", data().display());
        return;
    }
    let design = design();
    let rows = rows(&design);
    let options = Options {
        data: Some(data()),
        ..Options::default()
    };
    let epochs = feed(&design, &rows);
    let summary = run(&design, &options, &mut |_| {}).unwrap();
    // The same rows must give the same epochs. The estimate must be within 3 m, as in the test of this log.
    assert_eq!(summary.counts().epochs, epochs);
    assert!(summary.score().is_some_and(|s| s.horizontal_rms < 3.0));
    let mut group = c.benchmark_group("scenario/pntos");
    group.throughput(Throughput::Elements(epochs));
    group.bench_function("filter", |b| b.iter(|| feed(&design, &rows)));
    group.bench_function("run", |b| b.iter(|| run(&design, &options, &mut |_| {}).unwrap().counts().epochs));
    group.finish();
}

criterion_group! {
    name = all;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(15));
    targets = whole_process, benches
}
criterion_main!(all);
