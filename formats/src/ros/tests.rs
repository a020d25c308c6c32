//! Messages written by `rosbags` 0.11 (PyPI), with the values that it was given.

use super::*;
use crate::messages::Cells;
use rand::{RngExt, SeedableRng};

pub(crate) const DEFINITION: &str = "\
std_msgs/Header header
uint8 LIMIT=3
bool flag
byte b
int8 i8
uint8 u8
int16 i16
uint16 u16
int32 i32
uint32 u32
int64 i64
uint64 u64
float32 f32
string text
float64 f64
float64[2] fixed
int16[] many
float64[] wide
string[] names
Point[] points
TIME at
SPAN span
Nothing nothing
float64 last
===
MSG: test/Point
float32 x
uint8 kind
===
MSG: test/Nothing
===
MSG: std_msgs/Header
SEQ
TIME stamp
string frame_id
";

/// Two messages each. The second one has another number of elements in each array.
const ROS1: [&str; 2] = [
    "0000000000f1536515cd5b0703000000696d750107f8c8d4fe60ea90eefeff00286bee0000000000ffffff00000000000100800000003f030000006162639a9999999999b9bf000000000000f03f000000000000004002000000fffffeff0000000002000000010000007802000000797a020000000000c03f0100002040020500000006000000ffffffff070000000000000000000a40",
    "0100000001f1536515cd5b0703000000696d750107f8c8d4fe60ea90eefeff00286bee0000000000ffffff00000000000100800000003f02000000c3a99a9999999999b9bf000000000000f03f000000000000004003000000fffffefffdff0100000000000000000014400100000001000000780100000000001841090500000006000000ffffffff070000000000000000001140",
];
const CDR: [&str; 2] = [
    "0001000000f1536515cd5b0704000000696d75000107f8c8d4fe60ea90eefeff00286bee0000000000ffffff00000000000100800000003f0400000061626300000000009a9999999999b9bf000000000000f03f000000000000004002000000fffffeff0000000002000000020000007800000003000000797a0000020000000000c03f0100000000002040020000000500000006000000ffffffff07000000000000000000000000000a40",
    "0001000001f1536515cd5b0704000000696d75000107f8c8d4fe60ea90eefeff00286bee0000000000ffffff00000000000100800000003f03000000c3a90000000000009a9999999999b9bf000000000000f03f000000000000004003000000fffffefffdff00000100000000000000000014400100000002000000780000000100000000001841090000000500000006000000ffffffff0700000000000000000000000000000000001140",
];
/// The second message with the most significant byte first.
const BIG_ENDIAN: &str = "000000006553f101075bcd1500000004696d75000107f8c8fed4ea60fffeee90ee6b2800ffffff000000000080000100000000003f00000000000003c3a9000000000000bfb999999999999a3ff0000000000000400000000000000000000003fffffffefffd00000000000140140000000000000000000100000002780000000000000141180000090000000000000500000006ffffffff0000000700000000000000004011000000000000";

fn bytes(hex: &str) -> Vec<u8> {
    let digits = |k: usize| u8::from_str_radix(&hex[2 * k..2 * k + 2], 16).unwrap();
    (0..hex.len() / 2).map(digits).collect()
}

fn definitions(encoding: Encoding) -> Definitions {
    let (time, span, seq) = match encoding {
        Encoding::Ros1 => ("time", "duration", "uint32 seq"),
        Encoding::Cdr => ("builtin_interfaces/Time", "builtin_interfaces/Duration", ""),
    };
    let text = DEFINITION.replace("TIME", time).replace("SPAN", span).replace("SEQ", seq);
    Definitions::parse("test/msg/All", &text).unwrap()
}

fn shown(plan: &mut Plan, message: &[u8]) -> Vec<String> {
    let mut cells = Cells::default();
    plan.decode(message, 0, 5, 5, &mut cells).unwrap();
    (0..cells.len()).map(|k| cells.get(k).shown().into_owned()).collect()
}

/// `name value` of each cell.
fn named(plan: &mut Plan, message: &[u8]) -> Vec<String> {
    let cells = shown(plan, message);
    assert_eq!(cells.len(), plan.columns().len());
    plan.columns()
        .iter()
        .zip(cells)
        .map(|(name, cell)| format!("{name} {cell}"))
        .collect()
}

const FIRST: [&str; 30] = [
    "stamp 1700000000123456789",
    "log_time 5",
    "header.stamp 1700000000123456789",
    "header.frame_id imu",
    "flag 1",
    "b 7",
    "i8 -8",
    "u8 200",
    "i16 -300",
    "u16 60000",
    "i32 -70000",
    "u32 4000000000",
    "i64 -1099511627776",
    // 2⁶³ + 2⁴⁰ is beyond a whole number with a sign.
    "u64 9223373136366404000",
    "f32 0.5",
    "text abc",
    "f64 -0.1",
    "fixed[0] 1",
    "fixed[1] 2",
    "many[0] -1",
    "many[1] -2",
    "names[0] x",
    "names[1] yz",
    "points[0].x 1.5",
    "points[0].kind 1",
    "points[1].x 2.5",
    "points[1].kind 2",
    "at 5000000006",
    "span -999999993",
    "last 3.25",
];

/// The cells of the second message that differ from those of the first.
const SECOND: [&str; 7] = [
    "stamp 1700000001123456789",
    "header.stamp 1700000001123456789",
    "text é",
    "names[1] ",
    "points[0].x 9.5",
    "points[0].kind 9",
    "last 4.25",
];

#[test]
fn both_encodings_give_the_values_of_rosbags() {
    for (encoding, messages) in [(Encoding::Ros1, ROS1), (Encoding::Cdr, CDR)] {
        let [first, second] = messages.map(bytes);
        let mut plan = Plan::learn(&definitions(encoding), "test/All", encoding, &first, 0).unwrap();
        let is_ros1 = |name: &String| name.starts_with("header.seq");
        let named_first: Vec<String> = named(&mut plan, &first).into_iter().filter(|name| !is_ros1(name)).collect();
        assert_eq!(named_first, FIRST);
        let named_second: Vec<String> = named(&mut plan, &second).into_iter().filter(|name| !is_ros1(name)).collect();
        let changed: Vec<&String> = named_second.iter().filter(|cell| !FIRST.contains(&cell.as_str())).collect();
        let (gone, changed): (Vec<&String>, Vec<&String>) = changed.into_iter().partition(|cell| cell.starts_with("points[1]"));
        assert_eq!(changed, SECOND);
        // The second message has one point.
        assert_eq!(gone, ["points[1].x ", "points[1].kind "]);
    }
}

#[test]
fn both_orders_of_bytes_give_the_same_values() {
    let definitions = definitions(Encoding::Cdr);
    let [little, big] = [CDR[1], BIG_ENDIAN].map(|hex| {
        let message = bytes(hex);
        let mut plan = Plan::learn(&definitions, "test/All", Encoding::Cdr, &message, 0).unwrap();
        named(&mut plan, &message)
    });
    assert_eq!(little, big);
    assert!(little.contains(&"wide[0] 5".to_owned()));
}

#[test]
fn a_message_that_is_cut_off_is_an_error_and_no_panic() {
    for (encoding, [first, _]) in [(Encoding::Ros1, ROS1), (Encoding::Cdr, CDR)] {
        let (message, definitions) = (bytes(first), definitions(encoding));
        let mut plan = Plan::learn(&definitions, "test/All", encoding, &message, 0).unwrap();
        for length in 0..message.len() {
            let cut = &message[..length];
            plan.decode(cut, 0, 0, 0, &mut Cells::default()).unwrap_err();
            Plan::learn(&definitions, "test/All", encoding, cut, 0).unwrap_err();
        }
    }
}

#[test]
fn selected_columns_have_the_cells_that_they_have_among_all() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    for (encoding, messages) in [(Encoding::Ros1, ROS1), (Encoding::Cdr, CDR), (Encoding::Cdr, [CDR[0], BIG_ENDIAN])] {
        let messages = messages.map(bytes);
        let mut whole = Plan::learn(&definitions(encoding), "test/All", encoding, &messages[0], 0).unwrap();
        let all = [0, 1].map(|k| shown(&mut whole, &messages[k]));
        for _ in 0..100 {
            let share = random.random::<f64>();
            let wanted: Vec<usize> = (0..all[0].len()).filter(|_| random.random::<f64>() < share).collect();
            let mut plan = whole.clone();
            let selected = plan.select(&wanted).to_vec();
            // Both stamps, and the stamp of the header that the first one repeats, come with any selection.
            assert!(selected.is_sorted() && wanted.iter().all(|column| selected.contains(column)));
            assert!(selected.len() <= wanted.len() + 3, "{selected:?} for {wanted:?}");
            for (message, all) in messages.iter().zip(&all) {
                let expected: Vec<&String> = selected.iter().map(|column| &all[*column]).collect();
                assert_eq!(shown(&mut plan, message).iter().collect::<Vec<_>>(), expected, "{wanted:?}");
            }
            // Also a message that is cut off after the selected cells is an error.
            let cut = random.random_range(0..messages[0].len());
            plan.decode(&messages[0][..cut], 0, 0, 0, &mut Cells::default()).unwrap_err();
        }
    }
}

#[test]
fn a_message_may_have_another_alignment_than_the_first_one() {
    let definitions = Definitions::parse("a/T", "uint32 a\nfloat64 b\n").unwrap();
    let [a, b] = [&7_u32.to_le_bytes()[..], &1.5_f64.to_le_bytes()];
    let first = [&[0, 1, 0, 0], a, &[0; 4], b].concat();
    let mut plan = Plan::learn(&definitions, "a/T", Encoding::Cdr, &first, 0).unwrap();
    // The second version of CDR aligns to four bytes at most.
    let second = [&[0, 7, 0, 0], a, b].concat();
    for message in [&first, &second, &first] {
        assert_eq!(shown(&mut plan, message), ["5", "5", "7", "1.5"]);
    }
}

#[test]
fn the_elements_of_a_list_are_messages() {
    for (encoding, messages) in [(Encoding::Ros1, ROS1), (Encoding::Cdr, CDR)] {
        let definitions = definitions(encoding);
        let elements = Elements::find(&definitions, "test/All", "points", encoding).unwrap();
        let mut places = Vec::new();
        for (message, stamp, points) in [
            (messages[0], 1_700_000_000_123_456_789, &[["1.5", "1"], ["2.5", "2"]][..]),
            (messages[1], 1_700_000_001_123_456_789, &[["9.5", "9"]]),
        ] {
            let message = bytes(message);
            assert_eq!(elements.places(&message, &mut places).unwrap(), Some(stamp));
            assert_eq!(places.len(), points.len());
            for (place, point) in places.iter().zip(points) {
                let mut plan = Plan::learn(&definitions, &elements.name, encoding, &message, place.start).unwrap();
                assert_eq!(plan.columns(), ["stamp", "log_time", "x", "kind"]);
                let mut cells = Cells::default();
                plan.decode(&message, place.start, stamp, 5, &mut cells).unwrap();
                assert_eq!([2, 3].map(|k| cells.get(k).shown().into_owned()), *point);
            }
        }
        for (list, part) in [
            ("lines", "has no field `lines`"),
            ("many", "`many` is no list"),
            ("header.stamp", "no list"),
        ] {
            let error = Elements::find(&definitions, "test/All", list, encoding).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}

#[test]
fn a_definition_that_grows_without_end_is_an_error() {
    let nested: String = (0..20).map(|k| format!("N{0} a\nN{0}[2] b\n===\nMSG: n/N{0}\n", k + 1)).collect();
    let definitions = Definitions::parse("n/N0", &format!("{nested}uint8 x")).unwrap();
    let error = Plan::learn(&definitions, "n/N0", Encoding::Ros1, &[0; 64], 0).unwrap_err();
    assert!(error.contains("nested too deep"), "{error}");
    let wide: String = (0..14).map(|k| format!("N{0}[4] a\n===\nMSG: n/N{0}\n", k + 1)).collect();
    let definitions = Definitions::parse("n/N0", &format!("{wide}uint8 x")).unwrap();
    let error = Plan::learn(&definitions, "n/N0", Encoding::Ros1, &[0; 1 << 20], 0).unwrap_err();
    assert!(error.contains("more than 65536 values"), "{error}");
}
