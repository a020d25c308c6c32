//! Bytes of a text file, read as one of several declarations says: the first byte chooses.

#![no_main]

use fusion::rows::width;
use fusion::source::{CsvSpec, OpenContext, SourceSpec};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

/// Rows that are stopped at, left out, thinned, tied, restamped; every form of channel.
const DECLARED: [&str; 5] = [
    "path = 'PATH'
time = { column = 't' }
[channels.position]
latitude = 'lat'
longitude = 'lon'
height = 'h'
unit = 'deg'
[channels.position_sigma]
columns = ['s', 's', 's']
unit = 'm'",
    "path = 'PATH'
header = false
names = ['t', 'a', 'b', 'c', 'q']
bad_rows = 'skip'
rate = '100 Hz'
time = { column = 't', unit = 'ms', epoch = '1520530308000', backwards = 'skip', ties = 'skip', scale = 1.0001 }
valid = { column = 'q', at_least = 1 }
[channels.angular_rate]
columns = ['a', '-b', 'c']
unit = 'deg'
increment = true
average = true
rotation = { axes = ['-x', 'y', '-z'] }",
    "path = 'PATH'
bad_rows = 'skip'
repeats = 'drop'
delimiter = ';'
comment = '#'
time = { column = 't', unit = 'ns', backwards = 'skip', ties = 'keep', max_jump = '10 s', offset = '-1 h' }
keep = { except_every = 3, offset = 1 }
[channels.attitude]
quaternion = ['w', 'x', 'y', 'z']
inverse = true
navigation_rotation = { rpy = ['180 deg', 0, '90 deg'] }
[channels.speed]
column = 'v'
unit = 'km^2/h^2'
variance = true
offset = '1 m/s'",
    "path = 'PATH'
header = false
bad_rows = 'skip'
time = { column = '1', start = '1 s', stop = '1 h', backwards = 'skip', ties = 'skip' }
[channels.position]
north = '2'
east = '3'
up = '4'
[channels.heading]
column = '5'
unit = 'deg'
latency = '0.1 s'",
    "path = 'PATH'
header = 'comment'
comment = '#'
delimiter = 'blanks'
bad_rows = 'skip'
time = { date = 'd', column = 't', calendar = 'utc', backwards = 'skip', ties = 'skip' }
valid = { column = 'q', not_equals = [0, 'x'] }
channels.position = { utm = { easting = 'a', northing = 'b', zone = 31, hemisphere = 'south' }, height = 'c' }
channels.place = { ecef = ['a', 'b', 'c'], unit = 'km' }
channels.attitude = { euler = { order = 'zxz', columns = ['a', 'b', 'c'] }, unit = 'deg' }
channels.turn = { dcm = ['a', 'b', 'c', 'd', 'e', 'f', 'g', 'h', 'i'] }
channels.speed = { column = ['a', '-b'], unit = 'm/s' }
channels.velocity = { enu = ['a', 'b', 'c'], unit = 'm/s' }",
];

/// The file, and what is declared of it.
static SOURCES: LazyLock<(std::path::PathBuf, Vec<CsvSpec>)> = LazyLock::new(|| {
    let path = std::env::temp_dir().join(format!("fusion-fuzz-{}.csv", std::process::id()));
    let declared = DECLARED.map(|text| text.replace("PATH", &path.display().to_string()));
    let specs = declared.iter().map(|text| toml::from_str(text).expect("a sound declaration"));
    (path.clone(), specs.collect())
});

fuzz_target!(|bytes: &[u8]| {
    let Some((first, content)) = bytes.split_first() else { return };
    let (path, specs) = &*SOURCES;
    let spec = &specs[usize::from(*first) % specs.len()];
    std::fs::write(path, content).expect("a folder for temporary files");
    let origin = Some(fusion::core::geometry::wgs84::Geodetic::new(0.8, 0.1, 400.0));
    let context = OpenContext {
        origin,
        ..OpenContext::default()
    };
    let mut source = match spec.open(&context) {
        Ok(source) => source,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let (mut values, mut last) = (Vec::new(), i64::MIN);
    loop {
        match source.next(&mut values) {
            Ok(Some(stamp)) => {
                assert!(stamp.time.nanos() >= last, "{} after {last}", stamp.time);
                last = stamp.time.nanos();
                assert_eq!(values.len(), width(source.channels()));
                assert!(values.iter().all(|v| v.is_finite()), "{values:?}");
            }
            Ok(None) => break,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                break;
            }
        }
    }
    let report = source.report();
    assert_eq!(report.rows, report.used + report.left_out());
});
