//! Bags written here. Whole logs are compared with `rosbags` in `tests/suite/bags.rs`.

use super::*;
use crate::stamped::testing::{File, Shown, all, opened, survives_damage, whole};
use std::io::Write;

const DEFINITION: &str = "Header header\nfloat64 x\n===\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";

fn counted(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

/// A header of fields.
fn header(fields: &[(&str, &[u8])]) -> Vec<u8> {
    let fields = fields.iter().map(|(name, value)| counted(&[name.as_bytes(), b"=", value].concat()));
    fields.collect::<Vec<_>>().concat()
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    [counted(&header(fields)), counted(data)].concat()
}

fn connection(number: u32, topic: &str) -> Vec<u8> {
    let about = [("topic", topic), ("type", "a/T"), ("message_definition", DEFINITION)].map(|(name, value)| (name, value.as_bytes()));
    let fields: [(&str, &[u8]); 3] = [("op", &[7]), ("conn", &number.to_le_bytes()), ("topic", topic.as_bytes())];
    record(&fields, &header(&about))
}

fn message(connection: u32, seconds: u32) -> Vec<u8> {
    let data = [
        &[0; 4],
        &seconds.to_le_bytes()[..],
        &7_u32.to_le_bytes(),
        &counted(b"imu"),
        &f64::from(seconds).to_le_bytes(),
    ]
    .concat();
    let time = [seconds + 1, 9].map(u32::to_le_bytes).concat();
    record(&[("op", &[2]), ("conn", &connection.to_le_bytes()), ("time", &time)], &data)
}

fn chunk(packing: &str, records: &[u8]) -> Vec<u8> {
    let packed = match packing {
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(records).unwrap();
            encoder.finish().unwrap()
        }
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(records).unwrap();
            encoder.finish().unwrap()
        }
        _ => records.to_vec(),
    };
    let size = (records.len() as u32).to_le_bytes();
    record(&[("op", &[5]), ("compression", packing.as_bytes()), ("size", &size)], &packed)
}

/// A bag of two connections, with 50 messages each and without an index, and the place of its end.
fn bag(packing: &str) -> Vec<u8> {
    let heads = [connection(0, "/a"), connection(1, "/b")].concat();
    let messages: Vec<Vec<u8>> = (0..50).flat_map(|k| [message(0, k), message(1, k)]).collect();
    let bodies = messages.chunks(4).enumerate();
    let bodies = bodies.map(|(k, body)| [if k == 0 { heads.clone() } else { Vec::new() }, body.concat()].concat());
    let chunks: Vec<u8> = bodies.flat_map(|body| chunk(packing, &body)).collect();
    let begin = |end: u64| {
        let fields: [(&str, &[u8]); 4] = [
            ("op", &[3]),
            ("index_pos", &end.to_le_bytes()),
            ("conn_count", &[0; 4]),
            ("chunk_count", &[0; 4]),
        ];
        record(&fields, &[b' '; 32])
    };
    let end = 13 + begin(0).len() + chunks.len();
    [&b"#ROSBAG V2.0\n"[..], &begin(end as u64), &chunks].concat()
}

#[test]
fn chunks_of_all_packings_have_the_same_messages() {
    let expected = |topic: &str| -> Shown {
        let cells = ["3000000007", "4000000009", "0", "3000000007", "imu", "3"];
        (topic.to_owned(), cells.map(str::to_owned).to_vec())
    };
    for packing in ["none", "lz4", "bz2"] {
        let messages = whole::<BagReader>(".bag", &bag(packing));
        assert_eq!(messages.len(), 100, "{packing}");
        assert_eq!(messages[6..8], [expected("/a"), expected("/b")], "{packing}");
    }
}

#[test]
fn damaged_bags_give_the_messages_before_the_damage() {
    for packing in ["none", "lz4", "bz2"] {
        let bytes = bag(packing);
        survives_damage::<BagReader>(".bag", &bytes, bytes.len());
    }
}

#[test]
fn all_messages_before_a_cut_are_read() {
    let bytes = bag("none");
    for k in 0..50 {
        let record = message(0, k);
        let at = bytes.windows(record.len()).position(|bytes| bytes == record).unwrap();
        let file = File::new(".bag", &bytes[..at + record.len()]);
        let (messages, broken) = all(&mut opened::<BagReader>(&file.0, &[]).unwrap());
        assert_eq!(messages.len(), 2 * k as usize + 1);
        assert_eq!(broken.unwrap().message, "the file is cut off");
    }
}

#[test]
fn a_damaged_chunk_is_passed_over_and_counted() {
    for packing in ["lz4", "bz2"] {
        let mut bytes = bag(packing);
        let expected = whole::<BagReader>(".bag", &bytes);
        // The last bytes of the seventh of 25 chunks, which begin with the length of their header.
        let heads: Vec<usize> = (0..bytes.len()).filter(|at| bytes[*at..].starts_with(b"compression=")).collect();
        assert_eq!(heads.len(), 25);
        let damaged = heads[7] - 40..heads[7] - 30;
        bytes[damaged].fill(0xa5);
        let file = File::new(".bag", &bytes);
        let (messages, broken) = all(&mut opened::<BagReader>(&file.0, &[]).unwrap());
        // The records before the damage are used. Those after the chunk are all there.
        assert!((96..100).contains(&messages.len()), "{packing}: {}", messages.len());
        assert_eq!(messages[..24], expected[..24], "{packing}");
        assert_eq!(messages[messages.len() - 72..], expected[28..], "{packing}");
        let broken = broken.unwrap().message;
        assert!(broken.starts_with("a place is damaged, after byte"), "{broken}");
    }
}

#[test]
fn messages_of_connections_that_are_not_declared_are_counted() {
    let records = [connection(0, "/a"), message(0, 1), message(5, 2), message(0, 3)].concat();
    let bytes = [&b"#ROSBAG V2.0\n"[..], &chunk("none", &records)].concat();
    let file = File::new(".bag", &bytes);
    let (messages, broken) = all(&mut opened::<BagReader>(&file.0, &[]).unwrap());
    assert_eq!(messages.len(), 2);
    let expected = "1 message belongs to no channel that the file declares, the first to connection 5";
    assert_eq!(broken.unwrap().message, expected);
}
