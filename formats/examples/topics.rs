//! The time to read one topic, and all five topics, of a bag of ROS 2 in MCAP.
//!
//! ```text
//! cargo run --release -p fusion-formats --features mcap --example topics
//! ```
//!
//! The file has five topics of `sensor_msgs/Imu` with equal rates, as CDR in chunks that are not packed, or packed by lz4
//! or zstd. Rows are decoded and merged as in a run, without a filter. Times are the best of several readings, which take
//! turns.
//!
//! With paths of recorded logs as arguments, it reads the topic with the most messages, and the five topics with the
//! most messages, of each log. `--features all` reads all formats.

use fusion::config::{Diagnostics, Document};
use fusion::rows::Merged;
use fusion::source::table::{LogColumn, LogTable};
use fusion::source::{LogFormat, OpenContext, SourceSpec};
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const TOPICS: usize = 5;
const MESSAGES: u64 = 100_000;
const READINGS: usize = 9;
/// Messages in a chunk: about a megabyte.
const IN_CHUNK: u64 = 3_000;
const DEFINITION: &str = "\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    fusion_formats::link();
    let logs: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    if !logs.is_empty() {
        let measured = logs.iter().map(|log| recorded(log)).collect::<Result<String, Failure>>()?;
        return Ok(std::io::stdout().write_all(measured.as_bytes())?);
    }
    let folder = std::env::temp_dir().join(format!("fusion-topics-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let measured = ["", "lz4", "zstd"].into_iter().try_fold(String::new(), |lines, packing| {
        let bytes = write(&folder.join("log.mcap"), packing)?;
        let packed = if packing.is_empty() { "not packed" } else { packing };
        let head = format!("{TOPICS} topics of {MESSAGES} messages, {packed}\n");
        let declared = core::array::from_fn::<_, TOPICS, _>(imu_topic);
        Ok::<_, Failure>(lines + &head + &measure(&folder, &declared, bytes)?)
    });
    std::fs::remove_dir_all(&folder)?;
    std::io::stdout().write_all(measured?.as_bytes())?;
    Ok(())
}

/// One topic and five topics of a log that was recorded.
fn recorded(log: &Path) -> Result<String, Failure> {
    let mut tables = LogTable::read_all(log)?;
    tables.sort_by_key(|table| std::cmp::Reverse(table.rows()));
    let declared = tables.iter().filter_map(declared).take(TOPICS).collect::<Vec<_>>();
    let head = format!("{}, {} topics\n", log.display(), declared.len());
    Ok(head + &measure(log.parent().unwrap_or(log), &declared, std::fs::metadata(log)?.len())?)
}

/// A source, and the number of its rows.
struct Declared {
    source: String,
    rows: usize,
}

/// A source of the first six columns of numbers of a topic.
fn declared(table: &LogTable) -> Option<Declared> {
    let stamp = table.stamp.unwrap_or(0);
    let is_number = |(k, column): &(usize, &LogColumn)| *k != stamp && column.values.iter().all(|v| v.is_finite());
    let numbers = table.columns.iter().enumerate().filter(is_number).take(6);
    let names = numbers.map(|(_, column)| format!("{:?}", column.name)).collect::<Vec<_>>();
    let (format, topic) = (table.format.name, &table.topic.as_ref()?.name);
    let path = table.path.file_name()?;
    let stamp = &table.columns.get(stamp)?.name;
    let source = format!(
        "type = {format:?}\npath = {path:?}\ntopic = {topic:?}\ntime.column = {stamp:?}\n\
         [channels]\nnumbers = {{ columns = [{}], unit = \"1\" }}\n",
        names.join(", ")
    );
    let rows = table.rows();
    (!names.is_empty() && rows > 0).then_some(Declared { source, rows })
}

/// The times to read the first source, and all sources.
fn measure(folder: &Path, declared: &[Declared], bytes: u64) -> Result<String, Failure> {
    let counts = [1, declared.len()];
    let mut best = [Duration::MAX; 2];
    let mut read_rows = [(0, 0); 2];
    for _ in 0..READINGS {
        for (k, count) in counts.into_iter().enumerate() {
            let started = Instant::now();
            read_rows[k] = read(folder, &declared[..count])?;
            best[k] = best[k].min(started.elapsed());
        }
    }
    let megabytes = bytes as f64 / 1e6;
    let mut lines = String::new();
    for ((count, best), (rows, sum)) in counts.into_iter().zip(best).zip(read_rows) {
        let seconds = best.as_secs_f64();
        let rate = megabytes / seconds;
        writeln!(
            lines,
            "{count} read: {rows} rows, {:.1} ms, {rate:.0} MB/s, sum {sum:016x}",
            1e3 * seconds
        )?;
    }
    writeln!(lines, "ratio: {:.2}", best[1].as_secs_f64() / best[0].as_secs_f64())?;
    Ok(lines)
}

/// A source of a topic of the file of this program.
fn imu_topic(topic: usize) -> Declared {
    let vector = |name: &str| ["x", "y", "z"].map(|axis| format!("\"{name}.{axis}\"")).join(", ");
    let source = format!(
        "type = \"mcap\"\npath = \"log.mcap\"\ntopic = \"/imu{topic}\"\n[channels]\n\
         angular_rate = {{ columns = [{}], unit = \"rad/s\" }}\n\
         specific_force = {{ columns = [{}], unit = \"m/s^2\" }}\n",
        vector("angular_velocity"),
        vector("linear_acceleration"),
    );
    let rows = MESSAGES as usize;
    Declared { source, rows }
}

/// Reads topics by one source each, and returns the number of rows and a sum over all their bits.
fn read(folder: &Path, declared: &[Declared]) -> Result<(usize, u64), Failure> {
    let context = OpenContext {
        data_dir: folder.to_owned(),
        ..OpenContext::default()
    };
    let sources = declared.iter().map(|Declared { source, .. }| {
        let (document, _) = Document::parse("topics.toml", source);
        let mut problems = Diagnostics::new();
        let types: Vec<&str> = LogFormat::all().iter().map(|format| format.name).collect();
        let spec = document.root().read_block::<dyn SourceSpec>("source", &types, &mut problems);
        Ok(spec.ok_or_else(|| format!("{source}\n{problems:?}"))?.open(&context)?)
    });
    let mut merged = Merged::new(sources.collect::<Result<_, Failure>>()?);
    let (mut sum, mut rows) = (0_u64, 0);
    while let Some(row) = merged.next()? {
        let bits = row.values.iter().map(|value| value.to_bits());
        let bits = bits.chain([row.time.nanos() as u64, row.stream as u64]);
        sum = bits.fold(sum, |sum, bits| sum.rotate_left(5).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ bits);
        rows += 1;
    }
    assert_eq!(rows, declared.iter().map(|d| d.rows).sum::<usize>(), "rows are missing");
    Ok((rows, sum))
}

/// Writes the bag, and returns its length.
fn write(path: &Path, packing: &str) -> Result<u64, Failure> {
    let mut file = BufWriter::new(std::fs::File::create(path)?);
    file.write_all(b"\x89MCAP0\r\n")?;
    file.write_all(&record(1, &[counted(b""), counted(b"")].concat()))?;
    let texts = ["sensor_msgs/msg/Imu", "ros2msg", DEFINITION].map(|text| counted(text.as_bytes()));
    file.write_all(&record(3, &[&1_u16.to_le_bytes()[..], &texts.concat()].concat()))?;
    for topic in 0..TOPICS as u16 {
        let texts = [format!("/imu{topic}"), "cdr".to_owned(), String::new()].map(|text| counted(text.as_bytes()));
        file.write_all(&record(
            4,
            &[&topic.to_le_bytes()[..], &1_u16.to_le_bytes(), &texts.concat()].concat(),
        ))?;
    }
    let mut records = Vec::new();
    for k in 0..MESSAGES * TOPICS as u64 {
        let (topic, nanos) = ((k % TOPICS as u64) as u16, 1_700_000_000_000_000_000 + 2_000_000 * k);
        let head = [&topic.to_le_bytes()[..], &[0; 4], &nanos.to_le_bytes(), &nanos.to_le_bytes()].concat();
        records.extend(record(5, &[head, imu(nanos, k)].concat()));
        if (k + 1) % IN_CHUNK == 0 || k + 1 == MESSAGES * TOPICS as u64 {
            let length = (records.len() as u64).to_le_bytes();
            let check = crc32fast::hash(&records).to_le_bytes();
            let content = pack(packing, core::mem::take(&mut records))?;
            let packed_length = (content.len() as u64).to_le_bytes();
            let head = [&[0; 16][..], &length, &check, &counted(packing.as_bytes()), &packed_length].concat();
            file.write_all(&record(6, &[head, content].concat()))?;
        }
    }
    file.write_all(&record(15, &[0; 4]))?;
    file.write_all(&record(2, &[0; 20]))?;
    file.write_all(b"\x89MCAP0\r\n")?;
    Ok(file.into_inner()?.metadata()?.len())
}

/// A chunk as it is written.
fn pack(packing: &str, records: Vec<u8>) -> Result<Vec<u8>, Failure> {
    Ok(match packing {
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(&records)?;
            encoder.finish()?
        }
        "zstd" => ruzstd::encoding::compress_to_vec(records.as_slice(), ruzstd::encoding::CompressionLevel::Fastest),
        _ => records,
    })
}

/// A message of CDR.
fn imu(nanos: u64, k: u64) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(
        [nanos / 1_000_000_000, nanos % 1_000_000_000]
            .map(|part| (part as u32).to_le_bytes())
            .concat(),
    );
    bytes.extend(counted(b"imu\0"));
    let numbers = (0..37).map(|i| ((k * 37 + i) % 1009) as f64 * 1e-3);
    bytes.extend(numbers.flat_map(f64::to_le_bytes));
    bytes
}

fn record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind], &(content.len() as u64).to_le_bytes()[..], content].concat()
}

fn counted(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}
