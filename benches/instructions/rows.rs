//! Rows of text on their way in, and estimates on their way out.

use crate::composed::{Composed, DT, SCALES, fix, sample, started};
use crate::works::Count;
use fusion::config::Document;
use fusion::design::Design;
use fusion::output::{EstimateWriter, Origin};
use fusion::rows::Merged;
use fusion::source::OpenContext;
use std::fmt::Write as _;
use std::fs;
use std::hint::black_box;
use std::path::Path;

/// Rows of the inertial unit; a hundredth as many fixes.
const ROWS: usize = 1000;

const SOURCES: &str = r#"
[source.imu]
type = "csv"
path = "imu.csv"
time = { column = "t_s", unit = "s" }
[source.imu.channels]
angular_rate = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }

[source.gnss]
type = "csv"
path = "gnss.csv"
time = { column = "t_s", unit = "s" }
[source.gnss.channels]
position = { latitude = "lat", longitude = "lon", height = "h", unit = "rad" }
"#;

/// A file of `rows` samples every `dt` seconds, with all their digits.
fn write<const N: usize>(file: &Path, header: &str, rows: usize, dt: f64, row: impl Fn(usize) -> [f64; N]) {
    let mut text = format!("{header}\n");
    for k in 0..rows {
        write!(text, "{:.3}", k as f64 * dt).unwrap();
        row(k).iter().for_each(|v| write!(text, ",{v}").unwrap());
        text.push('\n');
    }
    fs::write(file, text).expect("room for a small log");
}

/// Both sources, opened anew.
fn opened(design: &Design, folder: &Path) -> Merged {
    let open = |named: &fusion::design::Named<fusion::design::SourceDesign>| {
        let context = OpenContext {
            data_dir: folder.to_owned(),
            name: named.name.clone(),
            ..OpenContext::default()
        };
        named.block.source.open(&context).expect("the log was written")
    };
    Merged::new(design.sources.iter().map(open).collect())
}

/// Reads all rows: how many there were.
fn read(mut rows: Merged) -> usize {
    let mut read = 0;
    while let Some(row) = rows.next().expect("the log is sound") {
        black_box(row.values);
        read += 1;
    }
    read
}

/// A row of text read, decoded and merged; a row fed to the runner, put in order and predicted with; an
/// estimate written.
pub fn works(count: Count<'_>) {
    let folder = std::env::temp_dir().join(format!("fusion-rows-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a temporary folder");
    write(&folder.join("imu.csv"), "t_s,wx,wy,wz,fx,fy,fz", ROWS, DT, sample);
    write(&folder.join("gnss.csv"), "t_s,lat,lon,h", ROWS / 100, 100.0 * DT, |k| fix(100 * k));
    let (document, mistakes) = Document::parse("rows.toml", &[&Composed::design(SCALES), SOURCES].concat());
    assert!(mistakes.is_empty(), "{mistakes:?}");
    let own = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
    // Opening is not counted: twice, as every work runs twice.
    let mut logs = [opened(&own, &folder), opened(&own, &folder)].into_iter();
    count("rows/decode and merge", ROWS, &mut || {
        assert_eq!(read(logs.next().expect("two runs")), ROWS + ROWS / 100);
    });
    let _ = fs::remove_dir_all(&folder);

    let (mut nav, mut next) = (started(SCALES), 1);
    count("rows/feed, order and predict/n=21", ROWS, &mut || {
        for k in next..next + ROWS {
            nav.feed("imu", k as f64 * DT, &sample(k)).expect("the row is sound");
        }
        next += ROWS;
    });

    let (solution, belief) = (nav.solution().expect("started"), nav.belief().expect("started"));
    let mut writer = EstimateWriter::new(std::io::sink(), nav.layout(), Origin::new(None)).expect("a sink takes all");
    count("rows/write an epoch/n=21", ROWS, &mut || {
        (0..ROWS).for_each(|_| writer.write(black_box(&solution), belief).expect("a sink takes all"));
    });
}
