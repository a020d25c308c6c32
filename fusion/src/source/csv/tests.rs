//! Files of all kinds, and the full text of the messages about them.

mod axes;
mod courses;
mod fields;
mod stamps;

use super::*;
use crate::config::{Diagnostics, Document, Node};
use crate::rows::{SourceReport, width};
use fusion_core::geometry::wgs84::Geodetic;
use fusion_models::block::Shape;
use std::io::Write;
use std::sync::atomic::{AtomicU32, Ordering};

/// A separate directory with one file, removed at the end.
struct Log {
    dir: PathBuf,
}

impl Log {
    fn new(bytes: &[u8]) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let own = format!("fusion-csv-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let dir = std::env::temp_dir().join(own);
        std::fs::create_dir_all(&dir).unwrap();
        std::fs::write(dir.join("log.csv"), bytes).unwrap();
        Self { dir }
    }

    fn context(&self) -> OpenContext {
        let origin = Some(Geodetic {
            lat: 0.7,
            lon: -1.5,
            height: 100.0,
        });
        OpenContext {
            data_dir: self.dir.clone(),
            name: "log".to_owned(),
            origin,
            seed: 1,
            ..OpenContext::default()
        }
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.dir);
    }
}

fn node(text: &str) -> Node {
    let (document, found) = Document::parse("filter.toml", text);
    assert!(found.is_empty(), "{found:?}");
    document.root().clone()
}

fn spec(node: &Node) -> Result<Box<dyn SourceSpec>, String> {
    let mut diagnostics = Diagnostics::new();
    let read = node.read_block::<dyn SourceSpec>("source", &["csv"], &mut diagnostics);
    read.ok_or_else(|| diagnostics.to_string())
}

type Rows = Vec<(i64, Vec<f64>)>;

/// All rows, or the error message, without the directory.
fn read(toml: &str, bytes: &[u8]) -> Result<(Rows, SourceReport), String> {
    let log = Log::new(bytes);
    let text = if toml.contains("path") {
        toml.to_owned()
    } else {
        format!("path = 'log.csv'\n{toml}")
    };
    let node = node(&format!("type = 'csv'\n{text}"));
    let spec = spec(&node)?;
    let shown = |error: SourceError| {
        let mut diagnostics = Diagnostics::new();
        diagnostics.extend(error.diagnostics(&node));
        let text = diagnostics.to_string();
        text.replace(&format!("{}/", log.dir.display()), "")
            .replace(&log.dir.display().to_string(), "DIR")
    };
    let mut source = spec.open(&log.context()).map_err(shown)?;
    assert_eq!(source.channels(), spec.channels().unwrap());
    let (mut rows, mut row) = (Vec::new(), Vec::new());
    while let Some(stamp) = source.next(&mut row).map_err(shown)? {
        assert_eq!(row.len(), width(source.channels()));
        rows.push((stamp.time.nanos(), row.clone()));
    }
    let report = source.report();
    assert_eq!((report.used, report.rows), (rows.len() as u64, report.used + report.left_out()));
    Ok((rows, report))
}

fn values(toml: &str, text: &str) -> Vec<Vec<f64>> {
    read(toml, text.as_bytes())
        .unwrap_or_else(|e| panic!("{e}"))
        .0
        .into_iter()
        .map(|(_, row)| row)
        .collect()
}

fn said(toml: &str, text: &str) -> String {
    read(toml, text.as_bytes()).unwrap_err()
}

const T: &str = "time = { column = 't' }\n";
const TV: &str = "time = { column = 't' }\nchannels.v = { column = 'v', unit = 'm/s' }\n";

fn gzip(text: &str) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn columns_become_channels_in_si_with_signs_and_scales() {
    let toml = format!(
        "{T}[channels]
        a_force = {{ columns = ['ax', '-ay', 'az'], unit = 'g', scale = [1, 1, 2], latency = '20 ms' }}
        b_heading = {{ column = '-yaw', unit = 'deg', offset = '90 deg' }}
        c_sigma = {{ column = 'var', unit = 'm^2', variance = true }}"
    );
    let text = "t,ax,ay,az,yaw,var\n1,1,2,3,30,4\n";
    let rows = values(&toml, text);
    let g = 9.80665;
    for (found, expected) in rows[0].iter().zip([g, -2.0 * g, 6.0 * g, 60f64.to_radians(), 2.0]) {
        // 2 ε: one more rounding than the direct product.
        assert!((found / expected - 1.0).abs() < 2.0 * f64::EPSILON, "{found} for {expected}");
    }
    let node = node(&format!("type = 'csv'\npath = 'x'\n{toml}"));
    let provided = spec(&node).unwrap().channels().unwrap();
    let seen: Vec<_> = provided
        .iter()
        .map(|p| (&*p.channel.name, p.offset, p.channel.width, p.channel.shape, p.delay_ns))
        .collect();
    let expected = [
        ("a_force", 0, 3, Shape::Vector, 20_000_000),
        ("b_heading", 3, 1, Shape::Angle, 0),
        ("c_sigma", 4, 1, Shape::Vector, 0),
    ];
    assert_eq!(seen, expected);
    assert_eq!(provided[2].channel.dimension.to_string(), "m");
}

#[test]
fn nanosecond_stamps_under_a_commented_header_are_read_exactly() {
    let toml = "
        time = { column = '#timestamp [ns]', unit = 'ns', epoch = 1520530308000000000 }
        channels.w = { column = 'w_x [rad s^-1]', unit = 'rad/s' }";
    let text = "#timestamp [ns],w_x [rad s^-1]\n1520530308181901469,0.1\n1520530308186917469,0.2\n";
    let (rows, report) = read(toml, text.as_bytes()).unwrap();
    assert_eq!(rows, [(181_901_469, vec![0.1]), (186_917_469, vec![0.2])]);
    assert_eq!(
        report.longest_gap.map(|(at, gap)| (at.nanos(), gap)),
        Some((181_901_469, 5_016_000.0 * 1e-9))
    );
}

#[test]
fn a_nominal_interval_keeps_the_jitter_of_stamps_out_of_the_rates() {
    let toml = "rate = '10 Hz'\ninterval = 'nominal'\ntime = { column = 't' }
        channels.w = { columns = ['d'], unit = 'rad', increment = true }";
    let text = "t,d\n1,1\n1.09,1\n1.21,1\n";
    let (rows, _) = read(toml, text.as_bytes()).unwrap();
    assert_eq!(rows.iter().map(|(_, row)| row[0]).collect::<Vec<_>>(), [10.0, 10.0, 10.0]);
    let error = read(&toml.replace("rate = '10 Hz'\n", ""), text.as_bytes()).unwrap_err();
    assert!(error.to_string().contains("needs the nominal `rate`"), "{error}");
}

#[test]
fn increments_become_rates_over_the_interval_since_the_previous_stamp() {
    let toml = "rate = '10 Hz'\ntime = { column = 't' }\nbad_rows = 'skip'
        channels.w = { columns = ['d'], unit = 'rad', increment = true }";
    // Nominal at first, 0.05 s, an unreadable value but a known stamp, an unreadable stamp, a gap.
    let text = "t,d\n1,1\n1.05,1\n1.15,x\n1.25,1\nx,1\n1.45,1\n2.45,1\n";
    let (rows, report) = read(toml, text.as_bytes()).unwrap();
    let rates: Vec<f64> = rows.iter().map(|(_, row)| (row[0] * 1e9).round() / 1e9).collect();
    assert_eq!(rates, [10.0, 20.0, 10.0, 10.0, 10.0]);
    assert_eq!((report.skipped[0].count, report.skipped[0].examples[1].number), (2, 6));
    let (rows, report) = read(&toml.replace("rate = '10 Hz'\n", ""), text.as_bytes()).unwrap();
    assert_eq!(rows.iter().map(|(_, row)| row[0].round()).collect::<Vec<_>>(), [20.0, 10.0, 1.0]);
    assert!(
        report.skipped.iter().any(|s| s.count == 2 && s.reason.contains("declare `rate`")),
        "{report}"
    );
}

#[test]
fn samples_can_be_averaged_into_rates_over_their_interval() {
    assert_eq!(
        values(&TV.replace("unit", "average = true, unit"), "t,v\n1,2\n2,4\n3,8\n"),
        [[2.0], [3.0], [6.0]]
    );
}

#[test]
fn sensor_axes_are_turned_into_body_axes() {
    let axes = |rotation: &str| {
        let toml = format!("{T}channels.f = {{ columns = ['x', 'y', 'z'], rotation = {rotation} }}");
        values(&toml, "t,x,y,z\n1,1,2,3\n")[0].clone()
    };
    assert_eq!(axes("{ axes = ['-x', 'y', '-z'] }"), [-1.0, 2.0, -3.0]);
    assert_eq!(axes("{ axes = ['y', 'z', 'x'] }"), [2.0, 3.0, 1.0]);
    let turned = axes("{ rpy = ['180 deg', 0, '90 deg'] }");
    // Roll by a half turn gives (1, −2, −3), yaw by a quarter (2, 1, −3).
    for (found, expected) in turned.into_iter().zip([2.0, 1.0, -3.0]) {
        assert!((found - expected).abs() < 1e-14, "{found} for {expected}");
    }
}

#[test]
fn positions_are_geodetic_whether_in_degrees_or_in_metres_from_the_origin() {
    let toml = format!("{T}channels.p = {{ latitude = 'lat', longitude = 'lon', height = 'h', unit = 'deg', height_unit = 'ft' }}");
    assert_eq!(
        values(&toml, "t,lat,lon,h\n1,40.5,-105,10\n"),
        [[40.5f64.to_radians(), (-105f64).to_radians(), 3.048]]
    );
    let local = format!("{T}channels.p = {{ north = 'n', east = '-w', up = 'u' }}");
    let p = &values(&local, "t,n,w,u\n1,100,50,20\n")[0];
    let origin = Geodetic {
        lat: 0.7,
        lon: -1.5,
        height: 100.0,
    };
    let ned = fusion_models::earth::LocalFrame::new(origin).to_ned(&Geodetic {
        lat: p[0],
        lon: p[1],
        height: p[2],
    });
    // 1 µm: the rounding of Earth-centred metres, 6.4e6 · 2⁻⁵², a few times over.
    assert!((ned - nalgebra::Vector3::new(100.0, -50.0, -20.0)).norm() < 1e-6, "{ned}");
}

#[test]
fn a_quaternion_of_an_east_north_up_world_becomes_body_to_ned() {
    let toml = format!(
        "{T}channels.q = {{ quaternion = ['w', 'x', 'y', 'z'], navigation_rotation = {{ axes = ['y', 'x', '-z'] }}, \
         rotation = {{ axes = ['x', '-y', '-z'] }} }}"
    );
    // Forward-left-up axes turned from east by 90° to the left look north: no rotation in NED.
    let half = 0.5f64.sqrt();
    let q = &values(&toml, &format!("t,w,x,y,z\n1,{half},0,0,{half}\n"))[0];
    assert!((q[0].abs() - 1.0).abs() < 1e-12, "{q:?}");
    // A sensor that looks right of the body, itself looking north: the body looks west.
    let mounted = format!("{T}channels.q = {{ quaternion = ['w', 'x', 'y', 'z'], rotation = {{ rpy = [0, 0, '90 deg'] }} }}");
    for (found, expected) in values(&mounted, "t,w,x,y,z\n1,1,0,0,0\n")[0].iter().zip([half, 0.0, 0.0, -half]) {
        assert!((found - expected).abs() < 1e-15, "{found} for {expected}");
    }
    let back = values(
        &format!("{T}channels.q = {{ quaternion = ['w', 'x', 'y', 'z'], inverse = true }}"),
        "t,w,x,y,z\n1,0.6,0.8,0,0\n",
    );
    for (found, expected) in back[0].iter().zip([0.6, -0.8, 0.0, 0.0]) {
        assert!((found - expected).abs() < 1e-15);
    }
}

#[test]
fn gzip_is_recognised_by_content_and_may_be_of_several_members() {
    let mut bytes = gzip("t,v\n1,1\n2,2\n");
    bytes.extend(gzip("3,3\n"));
    assert_eq!(read(TV, &bytes).unwrap().0.len(), 3);
}

#[test]
fn dialects_of_tables_are_read() {
    let table = "delimiter = ';'\ncomment = '%'\n".to_owned() + TV;
    assert_eq!(
        values(&table, "% made by x\nt; v ;\r\n1; 2.5;\r\n\r\n% pause\r\n2;+3e0;\r\n"),
        [[2.5], [3.0]]
    );
    let named = format!("names = ['t', 'v']\n{TV}");
    assert_eq!(values(&named, "1,2\n2,3\n"), [[2.0], [3.0]]);
    let numbered = "header = false\ntime = { column = '1' }\nchannels.v = { column = '-2' }";
    assert_eq!(values(numbered, "1,2\n2,3\n"), [[-2.0], [-3.0]]);
    assert_eq!(values(TV, "\u{feff}t,\"v\"\n1,\"2\"\n"), [[2.0]]);
}

#[test]
fn rows_are_chosen_by_conditions_on_any_column() {
    let text = "t,v,q,s\n1,1,1,A\n2,2,2,A\n3,3,1,V\n4,4,5,A\n";
    let chosen = |valid: &str| {
        values(&format!("valid = {valid}\n{TV}"), text)
            .into_iter()
            .map(|r| r[0])
            .collect::<Vec<_>>()
    };
    assert_eq!(chosen("{ column = 'q', equals = 1 }"), [1.0, 3.0]);
    assert_eq!(chosen("{ column = 'q', equals = [1, 5] }"), [1.0, 3.0, 4.0]);
    assert_eq!(
        chosen("[{ column = 's', equals = 'A' }, { column = 'q', at_least = 2, at_most = 4 }]"),
        [2.0]
    );
}

#[test]
fn thinned_rows_and_the_withheld_ones_complement_each_other() {
    let text = "t,v\n0,0\n1,1\n2,2\n3,3\n4,x\n5,5\n";
    let kept = |keep: &str| {
        let toml = format!("bad_rows = 'skip'\nkeep = {keep}\n{TV}");
        values(&toml, text).into_iter().map(|r| r[0]).collect::<Vec<_>>()
    };
    assert_eq!(kept("{ every = 3, offset = 1 }"), [1.0]);
    assert_eq!(kept("{ except_every = 3, offset = 1 }"), [0.0, 2.0, 3.0, 5.0]);
}

#[test]
fn repeated_values_and_late_stamps_are_left_out_as_declared_and_counted() {
    let toml = "repeats = 'drop'\n".to_owned() + &TV.replace("'t' }", "'t', backwards = 'skip', ties = 'skip' }");
    let (rows, report) = read(&toml, b"t,v\n1,1\n2,1\n3,2\n2.5,7\n3,8\n4,1\n").unwrap();
    assert_eq!(rows.iter().map(|(_, r)| r[0]).collect::<Vec<_>>(), [1.0, 2.0, 1.0]);
    let expected = "\
3 of 6 rows, 3.0 s at 0.667 Hz, longest gap 2.000 s at 1.000 s
  left out 1: repeats the values before
  left out 1: time runs backwards
    line 5: time runs backwards: 2.500000 s comes after 3.000000 s
  left out 1: the stamp of the row before
    line 6: the stamp 3.000000 s is equal to that of the row before";
    assert_eq!(report.to_string(), expected);
    let kept = TV.replace("'t' }", "'t', ties = 'keep' }");
    assert_eq!(values(&kept, "t,v\n1,1\n1,2\n").len(), 2);
}

#[test]
fn bad_rows_are_skipped_where_that_is_declared_and_reported_by_line() {
    let toml = format!("bad_rows = 'skip'\n{TV}");
    let (rows, report) = read(&toml, b"t,v\n\n1,1\n2\nx,3\n4,nan\n5,5\n6").unwrap();
    assert_eq!(rows.len(), 2);
    let expected = "\
2 of 6 rows, 4.0 s at 0.250 Hz, longest gap 4.000 s at 1.000 s
  left out 4: bad rows
    line 4: this row has 1 field, not 2
    line 5: `x` in column `t` is not a number
    line 6: `nan` in column `v` is not finite";
    assert_eq!(report.to_string(), expected);
}

#[test]
fn cells_that_stop_a_run_are_named_with_line_and_column() {
    let skip = "to leave such rows out and have them counted, write `bad_rows = \"skip\"`";
    let cases = [
        ("t,v\n1,1\n2,abc\n", "`abc` in column `v` is not a number", 3, skip.to_owned()),
        ("t,v\n1,\n", "column `v` is empty", 2, skip.to_owned()),
        ("t,v\n\n\n1,inf\n", "`inf` in column `v` is not finite", 4, skip.to_owned()),
        ("t,v\n1,1\n\r\n2,x\n", "`x` in column `v` is not a number", 4, skip.to_owned()),
        ("t,v\n1,inf\n", "`inf` in column `v` is not finite", 2, skip.to_owned()),
        (
            "t,v\n1,1\n2\n",
            "this row has 1 field, not 2",
            3,
            format!("is it cut off? T{}", &skip[1..]),
        ),
        (
            "t,v\n1,1,5\n",
            "this row has 3 fields, not 2",
            2,
            format!("is there a delimiter, or a decimal comma, within a field? T{}", &skip[1..]),
        ),
        ("t,v\n12:30,1\n", "`12:30` in column `t` is not a number", 2, skip.to_owned()),
        (
            "t,v\n1520530308181901469,1\n",
            "`1520530308181901469` in column `t` lies beyond the 292 years that a log spans: set `time.epoch`, or \
             another `time.unit`",
            2,
            skip.to_owned(),
        ),
        (
            "t,v\n2,1\n1,1\n",
            "time runs backwards: 1.000000 s comes after 2.000000 s",
            3,
            "sort the file, or leave such rows out: `time.backwards = \"skip\"`".to_owned(),
        ),
        (
            "t,v\n2,1\n2,1\n",
            "the stamp 2.000000 s is equal to that of the row before",
            3,
            "leave such rows out by `time.ties = \"skip\"`, or use them by `time.ties = \"keep\"`".to_owned(),
        ),
    ];
    for (text, message, line, help) in cases {
        assert_eq!(said(TV, text), format!("error: {message}\n--> log.csv:{line}\n = help: {help}"));
    }
}

#[test]
fn a_latency_of_hours_is_refused() {
    let late = |latency| {
        said(
            &format!("{T}channels.v = {{ column = 'v', unit = 'm/s', latency = '{latency}' }}"),
            "t,v\n",
        )
    };
    let said = late("-3601 s");
    assert!(
        said.starts_with("error: -3601 s is more than the longest delay of 3600 s: all rows"),
        "{said}"
    );
    assert!(said.contains("^^^^^^^^^\n"), "{said}");
    assert!(!late("1 h").contains("longest"), "{}", late("1 h"));
}

#[test]
fn values_that_cannot_be_are_refused() {
    let geodetic = format!("{T}channels.p = {{ latitude = 'a', longitude = 'b', height = 'c', unit = 'rad' }}");
    let expected = "error: 40.1 rad in column `a` is not a latitude: it lies beyond a pole\n--> log.csv:2\n = help: if the columns are in degrees, write `unit = \"deg\"`;";
    assert!(said(&geodetic, "t,a,b,c\n1,40.1,-105,3\n").starts_with(expected));
    let sigma = format!("{T}channels.s = {{ column = 'a', unit = 'm^2', variance = true }}");
    assert!(said(&sigma, "t,a\n1,-4\n").starts_with("error: the variance -4 in column `a` is negative\n--> log.csv:2"));
    let attitude = format!("{T}channels.q = {{ quaternion = ['a', 'b', 'c', 'd'] }}");
    assert!(said(&attitude, "t,a,b,c,d\n1,0,0,0,0\n").starts_with("error: the quaternion has norm 0, not 1\n--> log.csv:2"));
    assert!(said(TV, "t,v\n1,0\n2,1e38\n").starts_with("error: 1e38 cannot be: a speed [m/s] is at most 2.99792458e8\n--> log.csv:3"));
    let sigma = format!("{T}channels.v_sigma = {{ column = 's', unit = 'm/s' }}");
    assert!(said(&sigma, "t,s\n1,0.1\n2,0\n").starts_with("error: a 1σ is above zero, not 0\n--> log.csv:3"));
    let flag = format!("valid = {{ column = 'q', equals = 1 }}\n{T}");
    assert!(said(&flag, "t,q\n1,x\n").starts_with("error: `x` in column `q` is not a number\n--> log.csv:2"));
}

#[test]
fn a_missing_column_is_underlined_in_the_declaration() {
    let toml = "time = { column = 'T' }\nchannels.v = { columns = ['v', '-dthx'] }";
    let expected = "\
error: `log.csv` has no column `T`
 --> filter.toml:3:19
  |
3 | time = { column = 'T' }
  |                   ^^^
  |
  = help: did you mean `t`? its columns: `t`, `v`, `dthx_rad`

error: `log.csv` has no column `dthx`
 --> filter.toml:4:26
  |
4 | channels.v = { columns = ['v', '-dthx'] }
  |                          ^^^^^^^^^^^^^^
  |
  = help: did you mean `dthx_rad`? its columns: `t`, `v`, `dthx_rad`";
    assert_eq!(said(toml, "t,v,dthx_rad\n"), expected);
}

#[test]
fn a_missing_file_says_where_it_was_looked_for() {
    let expected = "\
error: `logg.csv` cannot be read: there is no such file
 --> filter.toml:2:8
  |
2 | path = 'logg.csv'
  |        ^^^^^^^^^^
  |
  = help: did you mean `log.csv`, next to it?";
    assert_eq!(said(&format!("path = 'logg.csv'\n{TV}"), ""), expected);
    let elsewhere = said(&format!("path = 'far/away.csv'\n{TV}"), "");
    assert!(
        elsewhere.ends_with("= help: a relative path starts at the data directory, `DIR`"),
        "{elsewhere}"
    );
    assert!(said(&format!("path = ''\n{TV}"), "").starts_with("error: `` is a directory, not a file"));
}

#[test]
fn files_without_usable_rows_are_errors() {
    assert_eq!(said(TV, ""), "error: this file is empty\n--> log.csv");
    assert_eq!(said(TV, "t,v\n"), "error: this file has no rows\n--> log.csv");
    let late = said(&TV.replace("'t' }", "'t', start = '1 h' }"), "t,v\n1,1\n2,1\n");
    assert_eq!(
        late,
        "error: no row of this file can be used: 2 × before the declared start\n--> log.csv"
    );
    let early = said(&TV.replace("'t' }", "'t', stop = '1 s' }"), "t,v\n1,1\n2,1\n");
    assert_eq!(
        early,
        "error: no row of this file can be used: the first is after the declared stop\n--> log.csv"
    );
    let bad = said(&format!("bad_rows = 'skip'\n{TV}"), "t,v\n1,x\n");
    let expected = "error: no row of this file can be used: 1 × bad rows\n--> log.csv:2\n = help: this is the first one: \
                    `x` in column `v` is not a number";
    assert_eq!(bad, expected);
}

#[test]
fn damaged_compression_is_an_error_even_where_bad_rows_are_skipped() {
    let toml = format!("bad_rows = 'skip'\n{TV}");
    let text: String = (0..5000).map(|k| format!("{k},{}\n", (k * k) % 977)).collect();
    let whole = gzip(&format!("t,v\n{text}"));
    let cut = read(&toml, &whole[..whole.len() / 2]).unwrap_err();
    assert!(cut.starts_with("error: the compressed file is cut off\n--> log.csv:"), "{cut}");
    let mut flipped = whole.clone();
    // The checksum is eight bytes before the end.
    let checksum = flipped.len() - 8;
    flipped[checksum] ^= 1;
    let damaged = read(&toml, &flipped).unwrap_err();
    assert!(damaged.starts_with("error: the file is damaged: corrupt gzip stream"), "{damaged}");
    let log = Log::new(b"");
    std::fs::write(log.dir.join("log.csv.gz"), "t,v\n1,1\n").unwrap();
    let node = node(&format!("type = 'csv'\npath = 'log.csv.gz'\n{TV}"));
    let error = spec(&node).unwrap().open(&log.context()).unwrap_err().to_string();
    assert!(
        error.ends_with("this file is not gzip-compressed, although its name ends in `.gz`"),
        "{error}"
    );
}

#[test]
fn all_mistakes_of_a_declaration_are_found_at_once() {
    let toml = "
        type = 'csv'
        path = 'x'
        time = { column = 't', unit = 'm', scale = 0, start = 2, stop = 1 }
        delimiter = 'é'
        valid = { column = 'q' }
        keep = { every = 2, except_every = 2 }
        [channels]
        a = { }
        b = { column = 'x', columns = ['y'] }
        c = { latitude = 'x', unit = 'deg' }
        d = { columns = ['x', 'y'], unit = 'metre', rotation = { axes = ['x', 'y', 'z'] } }
        e = { columns = ['x', 'y', 'z'], rotation = { axes = ['-x', 'y', 'z'] } }
        f = { quaternion = ['w', 'x', 'y', 'z'], unit = 'deg' }
        g = { column = 'x', unit = 'm', variance = true }
        h = { latitude = 'x', longitude = 'y', height = 'z' }
        i = { columns = ['x', 'y', 'z'], scale = [1, 2], offset = '1 deg' }
        j = { column = 'x', unit = 'rad', increment = true }
        k = { column = 'x', unit = 'deg', average = true }";
    let errors = spec(&node(toml)).unwrap().channels().unwrap_err();
    let seen: Vec<String> = errors.iter().map(|e| format!("{}: {}", e.field, e.message)).collect();
    let expected = [
        "time.unit: \"m\" is the unit of a length [m], not of a time",
        "time.scale: the scale of a clock is greater than 0 and near 1, e.g. 1.00002, not 0",
        "time.stop: `stop` is not later than `start`, so that no row is left: write a later `stop` or an earlier `start`",
        "channels.a: this channel names no columns",
        "channels.b: this channel is made in two ways",
        "channels.c: this channel misses `longitude`",
        "channels.d.unit: unknown unit `metre`; did you mean `m`?",
        "channels.d.columns: a rotation needs 3 columns, this channel has 2",
        "channels.e.rotation.axes: these axes turn a right-handed frame into a left-handed one",
        "channels.f.unit: `unit` does not apply to a quaternion",
        "channels.g.unit: with `variance = true` the unit is that of a variance",
        "channels.h: a latitude needs its unit",
        "channels.i.scale: 2 factors are given for 3 columns",
        "channels.i.offset: \"1 deg\" is an angle [rad]; a pure number [1] is expected here, e.g. \"2 %\"",
        "channels.k.average: angles that wrap have no plain mean",
        "valid: no condition is set on column `q`",
        "keep: rows are kept by `every` or by `except_every`",
        "keep: `j` holds increments, and rows that are left out would take their motion with them",
        "delimiter: this is one plain character, such as \",\", \";\" or \"\\t\"",
    ];
    assert_eq!(seen, expected);
}

#[test]
fn metres_need_an_origin() {
    let log = Log::new(b"t,n,e,d\n");
    let node = node(&format!(
        "type = 'csv'\npath = 'log.csv'\n{T}channels.p = {{ north = 'n', east = 'e', down = 'd' }}"
    ));
    let context = OpenContext {
        origin: None,
        ..log.context()
    };
    let error = spec(&node).unwrap().open(&context).unwrap_err();
    assert_eq!(error.to_string(), "channels.p: metres north, east and down need an origin");
}

#[test]
fn an_unknown_key_of_a_channel_is_underlined() {
    let toml = format!("{T}channels.v = {{ colum = 'v' }}");
    let text = said(&toml, "t,v\n1,1\n");
    assert!(text.starts_with("error: unknown field `colum`\n --> filter.toml:4:16"), "{text}");
    assert!(text.contains("did you mean `column`?"), "{text}");
}

#[test]
fn the_registered_example_is_a_sound_declaration() {
    let all = fusion_models::registry::all();
    let example = all.iter().find(|r| r.name == "csv").unwrap().example;
    let node = node(&format!("type = 'csv'\n{example}"));
    assert_eq!(spec(&node).unwrap().channels().unwrap().len(), 2);
}

#[test]
fn no_bytes_make_it_panic() {
    use proptest::prelude::*;
    let toml = format!("bad_rows = 'skip'\nvalid = {{ column = 'v', at_most = 1e9 }}\n{TV}");
    proptest!(ProptestConfig::with_cases(300), |(bytes in proptest::collection::vec(any::<u8>(), 0..200), rows in "(t,v\n)([0-9eE.,\"\n+-]{0,60})")| {
        let _ = read(&toml, &bytes);
        let _ = read(&toml, rows.as_bytes());
    });
}

#[test]
fn an_open_quotation_mark_is_told_with_the_lines_that_it_takes() {
    let open = said(TV, "t,v\n1,1\n2,\"2\n3,3\n4,4\n");
    assert!(open.contains("a quotation mark is open from line 3 to here"), "{open}");
    assert!(open.contains("log.csv:5"), "{open}");
    // A quotation mark in a line that is not a row has no effect, and closed quotation marks may hold any text.
    let units = format!("{TV}skip = 1");
    assert_eq!(values(&units, "t,v\ns,\"m\n1,1\n2,2\n"), [[1.0], [2.0]]);
    assert_eq!(values(TV, "t,v,note\n1,1,\"a\nb\"\n2,2,c\n"), [[1.0], [2.0]]);
}

#[test]
fn utf_16_is_told_from_damage() {
    let utf_16: Vec<u8> = "\u{feff}t,v\n1,1\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let error = read(TV, &utf_16).unwrap_err();
    assert!(error.contains("this file is UTF-16 text") && error.contains("iconv"), "{error}");
}
