//! Files written here. Whole logs are compared with the reference readers in `tests/suite/bags.rs`.

use super::*;
use crate::stamped::testing::{File, Shown, all, opened, survives_damage, whole};
use fusion::source::ArrivingBytes;
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};

const SECOND: u64 = 1_000_000_000;
const DEFINITION: &str = "std_msgs/Header header\nfloat64 x\nE[] e\n===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n\
                          string frame_id\n===\nMSG: a/E\nfloat64 y\n";

fn counted(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind], &(content.len() as u64).to_le_bytes()[..], content].concat()
}

fn schema(number: u16, name: &str, encoding: &str, data: &[u8]) -> Vec<u8> {
    let parts = [name.as_bytes(), encoding.as_bytes(), data].map(counted).concat();
    record(3, &[&number.to_le_bytes()[..], &parts].concat())
}

fn channel(number: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let texts = [topic.as_bytes(), encoding.as_bytes(), b""].map(counted).concat();
    record(4, &[&number.to_le_bytes()[..], &schema.to_le_bytes(), &texts].concat())
}

fn message(channel: u16, time: u64, data: &[u8]) -> Vec<u8> {
    let times = [time, time].map(u64::to_le_bytes).concat();
    record(5, &[&channel.to_le_bytes()[..], &[0; 4], &times, data].concat())
}

fn chunk(packing: &str, records: &[u8]) -> Vec<u8> {
    let packed = match packing {
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(records).unwrap();
            encoder.finish().unwrap()
        }
        "zstd" => ruzstd::encoding::compress_to_vec(records, ruzstd::encoding::CompressionLevel::Fastest),
        _ => records.to_vec(),
    };
    let sizes = [
        &[0; 16][..],
        &(records.len() as u64).to_le_bytes(),
        &crc32fast::hash(records).to_le_bytes(),
    ]
    .concat();
    let content = [
        sizes,
        counted(packing.as_bytes()),
        (packed.len() as u64).to_le_bytes().to_vec(),
        packed,
    ]
    .concat();
    record(6, &content)
}

/// A file of these records.
fn file(records: &[u8]) -> Vec<u8> {
    let header = record(1, &[counted(b""), counted(b"")].concat());
    let end = [record(0x0f, &[0; 4]), record(2, &[0; 20])].concat();
    [&b"\x89MCAP0\r\n"[..], &header, records, &end, b"\x89MCAP0\r\n"].concat()
}

/// A message of CDR with a header, a number, and elements.
fn cdr(seconds: u32, x: f64, elements: &[f64]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(seconds.to_le_bytes());
    // No nanoseconds, the text "i" with its end, and the gap before a number of eight bytes.
    bytes.extend([0, 0, 0, 0, 2, 0, 0, 0, b'i', 0, 0, 0]);
    bytes.extend(x.to_le_bytes());
    bytes.extend((elements.len() as u32).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(elements.iter().flat_map(|y| y.to_le_bytes()));
    bytes
}

/// Two topics of ROS 2, `count` messages each, in chunks of four.
fn bag(packing: Option<&str>, count: u32) -> Vec<u8> {
    let heads = [
        schema(1, "a/msg/T", "ros2msg", DEFINITION.as_bytes()),
        channel(7, 1, "/a", "cdr"),
        channel(8, 1, "/b", "cdr"),
    ];
    let times = (0..count).map(|k| (k, u64::from(k) * SECOND + 1));
    let messages = times.flat_map(|(k, time)| [message(7, time, &cdr(k, k.into(), &[])), message(8, time, &cdr(k, -1.0, &[]))]);
    let messages: Vec<Vec<u8>> = messages.collect();
    let bodies = messages.chunks(4).map(|chunk| chunk.concat()).enumerate();
    let bodies = bodies.map(|(k, body)| if k == 0 { [heads.concat(), body].concat() } else { body });
    let records: Vec<u8> = bodies
        .flat_map(|body| packing.map_or(body.clone(), |packing| chunk(packing, &body)))
        .collect();
    file(&records)
}

fn shown(topic: &str, cells: &[&str]) -> Shown {
    (topic.to_owned(), cells.iter().map(|cell| (*cell).to_owned()).collect())
}

const PACKINGS: [Option<&str>; 4] = [None, Some(""), Some("lz4"), Some("zstd")];

#[test]
fn chunks_of_all_packings_have_the_same_messages() {
    for packing in PACKINGS {
        let messages = whole::<McapReader>(".mcap", &bag(packing, 50));
        assert_eq!(messages.len(), 100, "{packing:?}");
        let cells = ["3000000000", "3000000001", "3000000000", "i", "3"];
        assert_eq!(messages[6], shown("/a", &cells), "{packing:?}");
        assert_eq!(messages[7].0, "/b");
    }
}

#[test]
fn damaged_files_give_the_messages_before_the_damage() {
    for packing in PACKINGS {
        let bytes = bag(packing, 50);
        // The records at the end have 13, 29 and 8 bytes.
        survives_damage::<McapReader>(".mcap", &bytes, bytes.len() - 50);
    }
}

#[test]
fn a_damaged_chunk_is_passed_over_and_counted() {
    for packing in ["", "lz4", "zstd"] {
        let whole = whole::<McapReader>(".mcap", &bag(Some(packing), 50));
        let mut bytes = bag(Some(packing), 50);
        // The records of the chunks begin after their head; the first chunk declares the channels.
        let chunks = |bytes: &[u8]| -> Vec<usize> {
            let mut at = 8;
            let mut found = Vec::new();
            while at < bytes.len() - 8 {
                if bytes[at] == 6 {
                    found.push(at);
                }
                at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
            }
            found
        };
        let chunks = chunks(&bytes);
        assert_eq!(chunks.len(), 25);
        for chunk in [3, 7] {
            bytes[chunks[chunk + 1].midpoint(chunks[chunk])] ^= 0x55;
        }
        let file = File::new(".mcap", &bytes);
        let (messages, broken) = all(&mut opened::<McapReader>(&file.0, &[]).unwrap());
        // If the packing finds the damage, the messages of the chunk before it are used.
        let is_lost = |message: &Shown| {
            whole
                .chunks(4)
                .enumerate()
                .any(|(k, of)| [3, 7].contains(&k) && of.contains(message))
        };
        let [others, expected] = [&messages, &whole].map(|all| all.iter().filter(|message| !is_lost(message)).collect::<Vec<_>>());
        assert!(others == expected && messages.len() < whole.len(), "{packing}: {}", messages.len());
        let broken = broken.unwrap().message;
        let first = chunks[3];
        assert!(
            broken.starts_with(&format!("2 places are damaged, the first after byte {first} (")),
            "{broken}"
        );
        let bytes = chunks[4] - chunks[3] + chunks[8] - chunks[7];
        assert!(broken.ends_with(&format!(": {bytes} bytes were skipped")), "{broken}");
    }
}

#[test]
fn messages_of_channels_that_are_not_declared_are_counted() {
    let z = [&[0, 1, 0, 0][..], &1.5f64.to_le_bytes()].concat();
    let heads = [schema(1, "a/T", "ros2msg", b"float64 z\n"), channel(1, 1, "/a", "cdr")].concat();
    let messages = [message(1, 1, &z), message(9, 2, &z), message(8, 3, &z), message(1, 4, &z)].concat();
    let file = File::new(".mcap", &file(&[heads, messages].concat()));
    let (messages, broken) = all(&mut opened::<McapReader>(&file.0, &[]).unwrap());
    assert_eq!(messages.len(), 2);
    let expected = "2 messages belong to no channel that the file declares, the first to channel 9";
    assert_eq!(broken.unwrap().message, expected);
}

#[test]
fn a_length_beyond_the_limit_takes_no_memory() {
    let mut bytes = file(&message(1, 0, &[]));
    let length = bytes.len() - 50 - 22 - 8;
    bytes[length..length + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    let file = File::new(".mcap", &bytes);
    let (_, broken) = all(&mut opened::<McapReader>(&file.0, &[]).unwrap());
    assert!(broken.unwrap().message.contains("a record of 18446744073709551615 bytes is beyond"));
}

#[test]
fn the_elements_of_a_list_are_messages_of_a_topic() {
    let heads = [schema(1, "a/T", "ros2msg", DEFINITION.as_bytes()), channel(7, 1, "/a", "cdr")].concat();
    let messages = [message(7, 5, &cdr(1, 0.5, &[])), message(7, 6, &cdr(2, 0.5, &[8.0, 9.0]))].concat();
    let file = File::new(".mcap", &file(&[heads, messages].concat()));
    let mut reader = opened::<McapReader>(&file.0, &[("/a", "e")]).unwrap();
    let (messages, broken) = all(&mut reader);
    assert_eq!(broken, None);
    let expected = [
        shown("/a", &["1000000000", "5", "1000000000", "i", "0.5"]),
        shown("/a", &["2000000000", "6", "2000000000", "i", "0.5"]),
        // The stamp is that of the message.
        shown("/a e[]", &["2000000000", "6", "8"]),
        shown("/a e[]", &["2000000000", "6", "9"]),
    ];
    assert_eq!(messages, expected);
    assert_eq!(
        (reader.columns(1), reader.topics()[1].message_type.as_str()),
        (&["stamp", "log_time", "y"].map(str::to_owned)[..], "a/E")
    );
    let (_, broken) = all(&mut opened::<McapReader>(&file.0, &[("/a", "z")]).unwrap());
    assert_eq!(broken.unwrap().message, "`a/T` has no field `z`");
}

#[test]
fn messages_of_json_have_the_columns_of_the_first_one() {
    let heads = [schema(1, "J", "jsonschema", b"{}"), channel(7, 1, "/j", "json")].concat();
    let first = br#"{"t": {"sec": 2, "nsec": 5}, "a": {"b": [1.5, -2]}, "ok": true, "s": "x\ty", "n": null}"#;
    let second = br#"{"s": "z", "more": [1], "a": {"b": [7, 8, 9]}, "t": {"nsec": 6, "sec": 2}, "ok": false}"#;
    let messages = [message(7, 5, first), message(7, 6, second), message(7, 7, b"{\"a\": {")].concat();
    let file = File::new(".mcap", &file(&[heads, messages].concat()));
    let mut reader = opened::<McapReader>(&file.0, &[]).unwrap();
    let (messages, broken) = all(&mut reader);
    assert_eq!(broken, None);
    assert_eq!(reader.columns(0), ["stamp", "log_time", "a.b[0]", "a.b[1]", "n", "ok", "s", "t"]);
    assert_eq!(messages[0], shown("/j", &["5", "5", "1.5", "-2", "", "1", "x\ty", "2000000005"]));
    assert_eq!(messages[1], shown("/j", &["6", "6", "7", "8", "", "0", "z", "2000000006"]));
    assert!(messages[2].1[0].contains("this message cannot be read: EOF"), "{:?}", messages[2]);
}

#[test]
fn channels_of_one_topic_are_one_stream_if_their_columns_are_equal() {
    let other = "float64 z\n";
    let heads = [
        schema(1, "a/T", "ros2msg", other.as_bytes()),
        schema(2, "b/U", "ros2msg", b"float32 w\n"),
        schema(3, "c/V", "omgidl", b"struct"),
        channel(1, 1, "/a", "cdr"),
        channel(2, 1, "/a", "cdr"),
        channel(3, 2, "/a", "cdr"),
        channel(4, 3, "/c", "cdr"),
    ];
    let z = [&[0, 1, 0, 0][..], &1.5f64.to_le_bytes()].concat();
    let messages: Vec<Vec<u8>> = (1..=4).map(|k| message(k, k.into(), &z)).collect();
    let file = File::new(".mcap", &file(&[heads.concat(), messages.concat()].concat()));
    let mut reader = opened::<McapReader>(&file.0, &[]).unwrap();
    let (messages, _) = all(&mut reader);
    let topics: Vec<&str> = messages.iter().map(|(topic, _)| topic.as_str()).collect();
    assert_eq!(topics, ["/a", "/a", "/a (2)", "/c"]);
    // Only stamps are known of a type that cannot be read; its name says why.
    assert_eq!(messages[3].1, ["4", "4"]);
    let about = &reader.topics()[2].message_type;
    assert_eq!(about, "c/V: messages of the encoding `cdr` with a schema of `omgidl` are not read");
}

#[test]
fn a_folder_is_read_in_the_order_of_its_files() {
    let folder = std::env::temp_dir().join(format!("fusion-mcap-folder-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let part = |x: f64| {
        let heads = [schema(1, "a/T", "ros2msg", DEFINITION.as_bytes()), channel(7, 1, "/a", "cdr")].concat();
        file(&[heads, message(7, 5, &cdr(1, x, &[]))].concat())
    };
    for (name, x) in [("bag_0", 0.0), ("bag_10", 10.0), ("bag_9", 9.0)] {
        std::fs::write(folder.join(format!("{name}.mcap")), part(x)).unwrap();
    }
    let read = || -> Vec<String> {
        let (messages, broken) = all(&mut opened::<McapReader>(&folder, &[]).unwrap());
        assert_eq!(broken, None);
        messages.into_iter().map(|(_, cells)| cells[4].clone()).collect()
    };
    assert_eq!(read(), ["0", "9", "10"]);
    let listed = "rosbag2_bagfile_information:\n  relative_file_paths:\n    - bag_9.mcap\n    - bag_0.mcap\n  duration:\n";
    std::fs::write(folder.join("metadata.yaml"), listed).unwrap();
    assert_eq!(read(), ["9", "0"]);

    let packed = ruzstd::encoding::compress_to_vec(
        std::fs::read(folder.join("bag_9.mcap")).unwrap().as_slice(),
        ruzstd::encoding::CompressionLevel::Fastest,
    );
    std::fs::write(folder.join("bag_9.mcap.zstd"), &packed).unwrap();
    std::fs::remove_file(folder.join("bag_9.mcap")).unwrap();
    std::fs::write(folder.join("metadata.yaml"), listed.replace("9.mcap", "9.mcap.zstd")).unwrap();
    assert_eq!(read(), ["9", "0"]);
    // A packed file by itself, and one that is cut off.
    let alone = File::new(".mcap.zstd", &packed);
    assert_eq!(all(&mut opened::<McapReader>(&alone.0, &[]).unwrap()).0.len(), 1);
    let cut = File::new(".mcap.zstd", &packed[..packed.len() - 9]);
    // The damage is found by the first bytes of the content, or later.
    match opened::<McapReader>(&cut.0, &[]) {
        Ok(mut reader) => assert!(all(&mut reader).1.is_some()),
        Err(why) => assert!(why.contains("frame") || why.contains("block"), "{why}"),
    }

    // The folder of the data is a relative path.
    let up: std::path::PathBuf = std::env::current_dir().unwrap().components().skip(1).map(|_| "..").collect();
    let context = OpenContext {
        data_dir: up.join(folder.parent().unwrap().strip_prefix("/").unwrap()),
        ..OpenContext::default()
    };
    let file = DataFile::new(Path::new(folder.file_name().unwrap()), &context);
    let (messages, broken) = all(&mut McapReader::open(&file, &context).unwrap());
    assert_eq!((messages.len(), broken), (2, None));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn all_messages_before_a_cut_are_read() {
    for packing in [None, Some("")] {
        let bytes = bag(packing, 10);
        for k in 0..10 {
            let record = message(7, u64::from(k) * SECOND + 1, &cdr(k, k.into(), &[]));
            let at = bytes.windows(record.len()).position(|bytes| bytes == record).unwrap();
            let file = File::new(".mcap", &bytes[..at + record.len()]);
            let (messages, broken) = all(&mut opened::<McapReader>(&file.0, &[]).unwrap());
            assert_eq!(messages.len(), 2 * k as usize + 1, "{packing:?}");
            assert!(broken.unwrap().message.contains("cut off"));
        }
    }
}

/// Bytes that have arrived. After the last of them the link is closed, or a reader must not wait for more.
#[derive(Clone, Default)]
struct Arrived(Arc<Mutex<(VecDeque<u8>, bool)>>);

impl Arrived {
    fn push(&self, bytes: &[u8]) {
        self.0.lock().unwrap().0.extend(bytes);
    }

    fn reader(&self) -> McapReader {
        let context = OpenContext {
            arriving: Some(ArrivingBytes::new(Box::new(self.clone()))),
            ..OpenContext::default()
        };
        McapReader::open(&DataFile::new(Path::new("no file"), &context), &context).unwrap()
    }
}

impl Read for Arrived {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let mut arrived = self.0.lock().unwrap();
        assert!(!arrived.0.is_empty() || arrived.1, "the reader waits for bytes beyond a record");
        // One byte at a time, as a slow link has them.
        arrived.0.read(&mut buffer[..1])
    }
}

#[test]
fn a_message_is_given_when_its_record_is_complete() {
    let heads = [schema(1, "a/T", "ros2msg", DEFINITION.as_bytes()), channel(7, 1, "/a", "cdr")].concat();
    let whole = file(&heads);
    for packing in PACKINGS {
        let arrived = Arrived::default();
        // All before the end of the data.
        arrived.push(&whole[..whole.len() - 50]);
        let mut reader = arrived.reader();
        for k in 0..3 {
            let record = message(7, k, &cdr(1, k as f64, &[]));
            arrived.push(&packing.map_or(record.clone(), |packing| chunk(packing, &record)));
            assert_eq!(reader.advance(), Ok(Some(0)));
            let mut cells = Cells::default();
            reader.decode(&mut cells).unwrap();
            assert_eq!(cells.shown(4), k.to_string());
        }
        arrived.0.lock().unwrap().1 = true;
        assert_eq!(reader.advance(), Ok(None), "{packing:?}");
    }
}

#[test]
fn arriving_bytes_that_end_within_a_record_are_reported() {
    let (arrived, bytes) = (Arrived::default(), bag(None, 2));
    arrived.push(&bytes[..bytes.len() - 51]);
    arrived.0.lock().unwrap().1 = true;
    let (messages, broken) = all(&mut arrived.reader());
    assert_eq!(messages.len(), 3);
    assert_eq!(broken.unwrap().message, "the file is cut off");
}

#[test]
fn sources_with_different_columns_of_a_topic_get_their_own_cells() {
    use fusion::source::decode::{Cell, RawRows};
    let heads = [schema(1, "a/T", "ros2msg", DEFINITION.as_bytes()), channel(7, 1, "/a", "cdr")].concat();
    let messages: Vec<u8> = (1..4)
        .flat_map(|k| message(7, 5, &cdr(k, f64::from(k), &[8.0, -f64::from(k)])))
        .collect();
    let file = File::new(".mcap", &file(&[heads, messages].concat()));
    let context = OpenContext::default();
    let of = || crate::messages::open::<McapReader>(&DataFile::new(&file.0, &context), &context, Some("/a"), None).unwrap();
    // The columns: stamp, log_time, header.stamp, header.frame_id, x, e[0].y, e[1].y.
    let (mut one, mut other) = (of(), of());
    one.select(&[4]);
    other.select(&[0, 6]);
    for k in 1..4 {
        assert!(one.advance().unwrap() && other.advance().unwrap());
        let x = f64::from(k);
        assert_eq!(one.cell(4), Cell::Number(x));
        assert_eq!(
            (other.cell(0), other.cell(6)),
            (Cell::Integer(i64::from(k) * 1_000_000_000), Cell::Number(-x))
        );
        // A cell that no source selects is empty.
        assert_eq!((one.cell(3), other.cell(5)), (Cell::Text(&[]), Cell::Text(&[])));
    }
    assert!(!one.advance().unwrap());
}
