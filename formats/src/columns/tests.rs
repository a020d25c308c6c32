//! Tables that the test writes, read back; damaged files.

use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::types::{Float64Type, Int8Type};
use arrow_array::{
    ArrayRef, BooleanArray, DictionaryArray, FixedSizeListArray, Float64Array, Int32Array, RecordBatch, StringArray, StructArray,
    TimestampMicrosecondArray, UInt64Array,
};
use fusion::models::registry;
use fusion::source::OpenContext;
use fusion::source::table::LogTable;
use rand::{RngExt as _, SeedableRng as _};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fusion-columns-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Rows whose numbers are known from their number `k`: t = 0.1 k, gyro = (k, −k, ½ k), with one of each type beside.
fn table(rows: usize) -> RecordBatch {
    let each = |of: fn(usize) -> f64| -> ArrayRef { Arc::new(Float64Array::from_iter_values((0..rows).map(of))) };
    let gyro = StructArray::try_from(vec![
        ("x", each(|k| k as f64)),
        ("y", each(|k| -(k as f64))),
        ("z", each(|k| 0.5 * k as f64)),
    ])
    .unwrap();
    let fixed = (0..rows).map(|k| Some(vec![Some(k as f64), None]));
    let fixed = FixedSizeListArray::from_iter_primitive::<Float64Type, _, _>(fixed, 2);
    let mut lists = ListBuilder::new(Float64Builder::new());
    for k in 0..rows {
        // Three elements in the first row, two in all others.
        lists.values().append_slice(&[k as f64, 2.0, 3.0][..if k == 0 { 3 } else { 2 }]);
        lists.append(true);
    }
    let names: DictionaryArray<Int8Type> = (0..rows).map(|k| Some(if k % 2 == 0 { "even" } else { "odd" })).collect();
    RecordBatch::try_from_iter([
        ("t", each(|k| 0.1 * k as f64)),
        ("gyro", Arc::new(gyro) as ArrayRef),
        ("fixed", Arc::new(fixed)),
        ("list", Arc::new(lists.finish())),
        ("name", Arc::new(names)),
        (
            "count",
            Arc::new(UInt64Array::from_iter_values((0..rows).map(|k| u64::MAX - k as u64))),
        ),
        ("is_even", Arc::new(BooleanArray::from_iter((0..rows).map(|k| Some(k % 2 == 0))))),
        (
            "may_be",
            Arc::new(Int32Array::from_iter((0..rows).map(|k| (k % 2 == 0).then_some(-7)))),
        ),
        (
            "text",
            Arc::new(StringArray::from_iter_values((0..rows).map(|k| format!("{}.5", k)))),
        ),
        (
            "stamp",
            Arc::new(TimestampMicrosecondArray::from_iter_values(
                (0..rows).map(|k| 1_700_000_000_000_000 + k as i64),
            )),
        ),
    ])
    .unwrap()
}

fn write(folder: &Path, rows: usize) -> [PathBuf; 2] {
    let table = table(rows);
    let [parquet, arrow] = ["drive.parquet", "drive.arrow"].map(|name| folder.join(name));
    let file = File::create(&parquet).unwrap();
    let mut writer = parquet::arrow::ArrowWriter::try_new(file, table.schema(), None).unwrap();
    writer.write(&table).unwrap();
    writer.close().unwrap();
    let mut writer = arrow_ipc::writer::FileWriter::try_new(File::create(&arrow).unwrap(), &table.schema()).unwrap();
    for from in (0..rows).step_by(1000) {
        writer.write(&table.slice(from, 1000.min(rows - from))).unwrap();
    }
    writer.finish().unwrap();
    [parquet, arrow]
}

#[test]
fn both_formats_obey_the_laws_of_sources() {
    let folder = Folder::new("laws");
    write(&folder.0, 2500);
    let context = OpenContext {
        data_dir: folder.0.clone(),
        ..OpenContext::default()
    };
    for name in ["parquet", "arrow"] {
        let own = registry::all().into_iter().find(|r| r.name == name).unwrap();
        fusion::source::testing::check(own, &context, 2500).unwrap();
    }
}

#[test]
fn every_type_is_read_back() {
    let folder = Folder::new("types");
    for path in write(&folder.0, 2500) {
        let table = LogTable::read(&path).unwrap();
        let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
        let vectors = [
            "gyro.x", "gyro.y", "gyro.z", "fixed[0]", "fixed[1]", "list[0]", "list[1]", "list[2]",
        ];
        let others = ["name", "count", "is_even", "may_be", "text", "stamp"];
        let all: Vec<&str> = ["t"].into_iter().chain(vectors).chain(others).collect();
        assert_eq!(names, all, "{}", path.display());
        let row = |k: usize| table.columns.iter().map(|column| column.values[k]).collect::<Vec<f64>>();
        let (nan, count) = (f64::NAN, u64::MAX as f64);
        let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
        let first = [0.0, 0.0, 0.0, 0.0, 0.0, nan, 0.0, 2.0, 3.0, nan, count, 1.0, -7.0, 0.5, 1.7e18];
        assert!(same(&row(0), &first), "{:?}", row(0));
        let (k, count) = (1501.0, (u64::MAX - 1501) as f64);
        let stamp = (1_700_000_000_000_000_000_i64 + 1_501_000) as f64;
        let later = [0.1 * k, k, -k, 0.5 * k, k, nan, k, 2.0, nan, nan, count, 0.0, nan, k + 0.5, stamp];
        assert!(same(&row(1501), &later), "{:?}", row(1501));
        assert_eq!(table.columns[9].first, "even");
        assert_eq!(table.columns[14].label.as_deref(), Some("stamp [ns]"));
    }
}

#[test]
fn a_file_that_is_cut_off_gives_the_rows_before_the_cut() {
    let folder = Folder::new("cut");
    let [parquet, arrow] = write(&folder.0, 2500);
    let whole = fs::read(&arrow).unwrap();
    fs::write(&arrow, &whole[..whole.len() * 2 / 3]).unwrap();
    let table = LogTable::read(&arrow).unwrap();
    assert_eq!((table.rows(), table.malformed), (1000, 1));
    // Parquet has its index at the end: without it no row can be found.
    let whole = fs::read(&parquet).unwrap();
    fs::write(&parquet, &whole[..whole.len() - 1]).unwrap();
    let error = LogTable::read(&parquet).unwrap_err().to_string();
    assert!(error.contains("drive.parquet: "), "{error}");
}

#[test]
fn a_damaged_file_is_no_more_than_an_error() {
    let folder = Folder::new("mutants");
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    for path in write(&folder.0, 300) {
        let whole = fs::read(&path).unwrap();
        let mut rows = 0;
        for _ in 0..500 {
            let mut mutant = whole.clone();
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..mutant.len());
                mutant[at] ^= 1 << rng.random_range(0..8);
            }
            if rng.random_range(0..4) == 0 {
                mutant.truncate(rng.random_range(0..whole.len()));
            }
            fs::write(&path, mutant).unwrap();
            rows += LogTable::read(&path).map_or(0, |table| table.rows());
        }
        assert!(rows > 0, "no mutant of {} could be read", path.display());
    }
}
