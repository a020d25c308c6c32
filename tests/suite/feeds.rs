use crate::support::Workspace;
use fusion::Selection;
use fusion::run::{Effort, Options, run};
use fusion::source::{Columns, Supply, Values};
use std::path::Path;

/// A CSV file as columns: stamps as they are written, numbers as numbers.
fn columns(file: &Path) -> Columns {
    let mut reader = csv::Reader::from_path(file).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let column = |k: usize| -> Values {
        let cells = || rows.iter().map(|row| row[k].to_owned());
        let numbers: Result<Vec<f64>, _> = cells().map(|cell| cell.parse()).collect();
        match numbers {
            Ok(numbers) if k > 0 => numbers.into(),
            _ => cells().collect::<Vec<String>>().into(),
        }
    };
    names
        .iter()
        .enumerate()
        .fold(Columns::default(), |all, (k, name)| all.with(name, column(k)))
}

#[test]
fn rows_in_memory_give_the_bytes_that_files_give() {
    let w = Workspace::new("feeds");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps-outlier.toml");
    w.fusion(&["record", design, "--out", "log"]).success();
    let recorded = Selection::default().load(w.path("log/design.toml")).unwrap();
    let from = |folder: &str, rows: bool, out: &str| {
        let mut options = Options {
            data: Some(w.path(folder)),
            base: w.path("log"),
            out: Some(w.path(out)),
            ..Options::default()
        };
        let names: Vec<&str> = recorded.sources.iter().map(|source| source.name.as_str()).collect();
        for source in recorded.sources.iter().filter(|_| rows) {
            let file = &source.block.source.files()[0];
            options
                .rows
                .insert(source.name.clone(), Supply::from(columns(&w.path("log").join(file))));
        }
        let summary = run(&recorded, &options, &mut |_| {}).unwrap_or_else(|d| panic!("{names:?}: {d}"));
        // Times differ from run to run.
        serde_json::to_string(&summary.with(Effort::default())).unwrap()
    };
    assert_eq!(from("log", false, "files"), from("nowhere", true, "memory"));
    for file in ["estimates.csv", "updates.csv"] {
        let [one, other] = ["files", "memory"].map(|out| w.read(&format!("{out}/{file}")));
        assert!(one.len() > 10_000 && one == other, "{file}");
    }
}

#[test]
fn columns_of_unlike_lengths_are_refused_with_their_name() {
    let w = Workspace::new("feeds-unlike");
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/ins-gps.toml");
    w.fusion(&["record", design, "--out", "log"]).success();
    let recorded = Selection::default().load(w.path("log/design.toml")).unwrap();
    let mut options = Options {
        data: Some(w.path("log")),
        ..Options::default()
    };
    let short = Columns::default().with("t_s", vec![0.0, 1.0]).with("x", vec![1.0]);
    options.rows.insert(recorded.sources[0].name.clone(), short.into());
    let told = run(&recorded, &options, &mut |_| {}).unwrap_err().to_string();
    assert!(told.contains("column `x` in memory has 1 rows, the longest one has 2"), "{told}");
}
