//! Bags written here by SQLite. Whole logs are compared with `rosbags` in `tests/suite/bags.rs`.

use super::*;
use crate::stamped::testing::{File, all, opened};
use rusqlite::Connection;

/// A `geometry_msgs/Vector3`.
fn vector(x: f64) -> Vec<u8> {
    let numbers = [x, 2.0, 3.0].map(f64::to_le_bytes).concat();
    [&[0, 1, 0, 0][..], &numbers].concat()
}

/// A bag with 2000 messages, in several pages; with the definition of the second topic if `has_definitions`.
fn bag(has_definitions: bool) -> File {
    written(has_definitions, |message| message)
}

/// The content in one frame of zstd.
fn packed(content: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(content, ruzstd::encoding::CompressionLevel::Fastest)
}

fn written(has_definitions: bool, pack: impl Fn(Vec<u8>) -> Vec<u8>) -> File {
    let file = File::new(".db3", &[]);
    let connection = Connection::open(&file.0).unwrap();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
        INSERT INTO topics VALUES (1, '/v', 'geometry_msgs/msg/Vector3', 'cdr', ''), (2, '/w', 'own_msgs/msg/W', 'cdr', '');
        BEGIN;";
    connection.execute_batch(tables).unwrap();
    for k in 0..1000_i64 {
        let insert = "INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?1, ?2), (2, ?1, ?2)";
        connection
            .execute(insert, (1_700_000_000_000_000_000 + k, pack(vector(k as f64))))
            .unwrap();
    }
    if has_definitions {
        let table =
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT, encoded_message_definition TEXT);
            INSERT INTO message_definitions VALUES (1, 'own_msgs/msg/W', 'ros2msg', 'float64 a');";
        connection.execute_batch(table).unwrap();
    }
    connection.execute_batch("COMMIT").unwrap();
    file
}

#[test]
fn the_usual_definitions_are_known_and_others_are_in_newer_bags() {
    for (has_definitions, columns) in [(true, &["stamp", "log_time", "a"][..]), (false, &["stamp", "log_time"])] {
        let file = bag(has_definitions);
        let mut reader = opened::<Rosbag2Reader>(&file.0, &[]).unwrap();
        let (messages, broken) = all(&mut reader);
        assert_eq!((messages.len(), broken), (2000, None));
        let cells = ["1700000000000000005", "1700000000000000005", "5", "2", "3"].map(str::to_owned);
        assert_eq!(messages[10], ("/v".to_owned(), cells.to_vec()));
        assert_eq!(reader.columns(0)[2..], ["x", "y", "z"].map(str::to_owned));
        assert_eq!(reader.columns(1), columns);
        let is_explained = reader.topics()[1].message_type.ends_with(": this file has no definition of it");
        assert_eq!(is_explained, !has_definitions);
    }
}

#[test]
fn packed_files_and_messages_have_the_content_of_a_bag_that_is_not_packed() {
    let plain = bag(true);
    let bytes = std::fs::read(&plain.0).unwrap();
    let read = |file: &File| all(&mut opened::<Rosbag2Reader>(&file.0, &[]).unwrap());
    let whole = read(&plain);
    assert_eq!((whole.0.len(), &whole.1), (2000, &None));
    let messages = written(true, |message| packed(&message));
    assert!(std::fs::read(&messages.0).unwrap() != bytes);
    assert_eq!(read(&messages), whole);
    // A file of two frames.
    let (first, second) = bytes.split_at(bytes.len() / 3);
    for content in [packed(&bytes), [packed(first), packed(second)].concat()] {
        assert_eq!(read(&File::new(".db3.zstd", &content)), whole);
        let cut = opened::<Rosbag2Reader>(&File::new(".db3.zstd", &content[..content.len() - 9]).0, &[]);
        assert!(cut.err().unwrap().contains("this packed file cannot be unpacked"));
    }
    let plainly = opened::<Rosbag2Reader>(&File::new(".db3.zstd", &bytes).0, &[]);
    assert!(plainly.err().unwrap().contains("this packed file cannot be unpacked"));
}

#[test]
fn a_damaged_packed_message_ends_the_bag_with_the_messages_before_it() {
    let whole = all(&mut opened::<Rosbag2Reader>(&bag(true).0, &[]).unwrap()).0;
    let damaged = written(true, |message| {
        let mut packed = packed(&message);
        if message == vector(600.0) {
            let last = packed.len() - 1;
            packed.truncate(last);
        }
        packed
    });
    let (messages, broken) = all(&mut opened::<Rosbag2Reader>(&damaged.0, &[]).unwrap());
    assert_eq!(messages, whole[..1200]);
    assert!(broken.is_some());
}

#[test]
fn damaged_bags_give_the_messages_before_the_damage() {
    use rand::{RngExt, SeedableRng};
    let bytes = std::fs::read(&bag(false).0).unwrap();
    let (whole, _) = all(&mut opened::<Rosbag2Reader>(&File::new(".db3", &bytes).0, &[]).unwrap());
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut reported = 0;
    for k in 0..500 {
        let mut damaged = bytes.clone();
        if k % 2 == 0 {
            damaged.truncate(random.random_range(0..bytes.len()));
        } else {
            for _ in 0..random.random_range(1..=8) {
                let at = random.random_range(0..damaged.len());
                damaged[at] = random.random();
            }
        }
        let file = File::new(".db3", &damaged);
        let Ok(mut reader) = opened::<Rosbag2Reader>(&file.0, &[]) else {
            reported += 1;
            continue;
        };
        let (messages, broken) = all(&mut reader);
        reported += usize::from(broken.is_some());
        if k % 2 == 0 {
            assert!(whole.starts_with(&messages), "{k}");
            // The end of the file has pages without messages.
            assert!(
                broken.is_some() || messages.len() == whole.len(),
                "{k}: {} messages",
                messages.len()
            );
        }
        assert!(messages.len() <= damaged.len());
    }
    assert!(reported > 200, "{reported}");
}
