//! Messages written by `protobuf` 7.36 (PyPI) with the descriptors that it gives, and the values that it was given.

use super::*;
use crate::messages::Cells;
use crate::stamped::Decoder;

/// The types `t.All`, `t.Sub` and `t.Kind`, then the file that has `google.protobuf.Timestamp`.
const DESCRIPTORS: &str = "0a87040a07742e70726f746f1201741a1f676f6f676c652f70726f746f6275662f74696d657374616d702e70726f746f223c0a0353756212130a02696418012001280e32072e742e4b696e6412090a017818022001280112150a05616761696e18032001280b32062e742e53756222ec020a03416c6c12260a02617418012001280b321a2e676f6f676c652e70726f746f6275662e54696d657374616d7012090a016418022001280112090a0166180320012802120b0a03693332180420012805120b0a03693634180520012803120b0a0375333218062001280d120b0a03753634180720012804120b0a03733332180820012811120b0a03733634180920012812120b0a03663332180a20012807120b0a03663634180b20012806120c0a0473663332180c2001280f120c0a0473663634180d2001281012090a0162180e20012808120c0a0474657874180f20012809120b0a0372617718102001280c12150a046b696e6418112001280e32072e742e4b696e6412130a0373756218122001280b32062e742e53756212140a047375627318132003280b32062e742e537562120e0a067061636b6564181420032810120d0a056e616d657318152003280912120a056d61796265181620012805480088010142080a065f6d617962652a230a044b696e6412080a044e4f4e45100012080a04474e5353100212070a0344564c1001620670726f746f330aff010a1f676f6f676c652f70726f746f6275662f74696d657374616d702e70726f746f120f676f6f676c652e70726f746f627566223b0a0954696d657374616d7012180a077365636f6e647318012001280352077365636f6e647312140a056e616e6f7318022001280552056e616e6f734285010a13636f6d2e676f6f676c652e70726f746f627566420e54696d657374616d7050726f746f50015a32676f6f676c652e676f6c616e672e6f72672f70726f746f6275662f74797065732f6b6e6f776e2f74696d657374616d707062f80101a20203475042aa021e476f6f676c652e50726f746f6275662e57656c6c4b6e6f776e5479706573620670726f746f33";
const FULL: &str = "0a080880e2cfaa06100511000000000000e0bf1d0000803e20fdffffffffffffffff01288080808080e0ffffff0130ffffffff0f3880808080808080808001400948ffffffffff7f550700000059080000000000000065f7ffffff69f6ffffffffffffff70017a026869820102787888010292010d11000000000000f83f1a0208019a010b08011100000000000024409a010b0802110000000000003440a20110ffffffffffffffff0200000000000000aa010170aa010171b00100";
/// Only some fields: `d`, an empty `sub`, an unknown `kind`, three `subs` and one of `packed`.
const SPARSE: &str = "1100000000000008408801099201009a010b0802110000000000003e409a010208079a01020801a201080400000000000000";

fn bytes(hex: &str) -> Vec<u8> {
    let digits = |k: usize| u8::from_str_radix(&hex[2 * k..2 * k + 2], 16).unwrap();
    (0..hex.len() / 2).map(digits).collect()
}

/// `name value` of each cell.
fn named(plan: &mut dyn Decoder, message: &[u8], place: Range<usize>) -> Vec<String> {
    let mut cells = Cells::default();
    plan.decode(message, place, 5, 6, &mut cells).unwrap();
    assert_eq!(plan.columns().len(), cells.len());
    let names = plan.columns().iter().enumerate();
    names.map(|(k, name)| format!("{name} {}", cells.get(k).shown())).collect()
}

#[test]
fn fields_of_all_types_have_the_values_of_the_reference() {
    let (schema, first) = (schema("t.All", &bytes(DESCRIPTORS)), bytes(FULL));
    let mut plan = schema.learn(&first, 0..first.len()).unwrap();
    let full = [
        "stamp 5",
        "log_time 6",
        "at 1700000000000000005",
        "d -0.5",
        "f 0.25",
        "i32 -3",
        "i64 -1099511627776",
        "u32 4294967295",
        "u64 9223372036854776000",
        "s32 -5",
        "s64 -2199023255552",
        "f32 7",
        "f64 8",
        "sf32 -9",
        "sf64 -10",
        "b 1",
        "text hi",
        "kind GNSS",
        "sub.id NONE",
        "sub.x 1.5",
        "sub.again.id DVL",
        "sub.again.x 0",
        "subs[0].id DVL",
        "subs[0].x 10",
        "subs[1].id GNSS",
        "subs[1].x 20",
        "packed[0] -1",
        "packed[1] 2",
        "names[0] p",
        "names[1] q",
        "maybe 0",
    ];
    assert_eq!(named(&mut *plan, &first, 0..first.len()), full);
    let sparse = bytes(SPARSE);
    let cells = named(&mut *plan, &sparse, 0..sparse.len());
    // Fields of proto3 have their default values; a message, an element and an `optional` number are absent.
    for cell in [
        "at ",
        "d 3",
        "f 0",
        "i64 0",
        "u64 0",
        "b 0",
        "text ",
        "kind 9",
        "sub.id NONE",
        "sub.x 0",
        "sub.again.x ",
        "subs[0].x 30",
        "subs[1].id 7",
        "subs[1].x 0",
        "packed[0] 4",
        "packed[1] ",
        "names[0] ",
        "maybe ",
    ] {
        assert!(cells.contains(&cell.to_owned()), "`{cell}` in {cells:?}");
    }
}

#[test]
fn the_elements_of_a_list_are_messages() {
    let (schema, first) = (schema("t.All", &bytes(DESCRIPTORS)), bytes(FULL));
    let list = schema.split("subs").unwrap();
    let (mut places, mut found) = (Vec::new(), Vec::new());
    for message in [first, bytes(SPARSE)] {
        assert_eq!(list.places(&message, &mut places), Ok(None));
        for place in &places {
            let mut plan = list.schema().0.learn(&message, place.clone()).unwrap();
            found.push(named(&mut *plan, &message, place.clone())[2..].join(", "));
        }
    }
    assert_eq!(
        found,
        ["id DVL, x 10", "id GNSS, x 20", "id GNSS, x 30", "id 7, x 0", "id DVL, x 0"]
    );
    for (list, part) in [
        ("lines", "no field `lines`"),
        ("packed", "is no list of messages"),
        ("sub", "is no list of messages"),
    ] {
        let error = schema.split(list).err().unwrap();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn damaged_bytes_are_errors_and_no_panic() {
    let (set, first) = (bytes(DESCRIPTORS), bytes(FULL));
    let mut plan = schema("t.All", &set).learn(&first, 0..first.len()).unwrap();
    let mut errors = 0;
    for at in 0..first.len() {
        for bit in 0..8 {
            let mut damaged = first.clone();
            damaged[at] ^= 1 << bit;
            errors += usize::from(plan.decode(&damaged, 0..damaged.len(), 0, 0, &mut Cells::default()).is_err());
        }
    }
    assert!(errors > first.len(), "{errors}");
    for at in 0..set.len() {
        let mut damaged = set.clone();
        damaged[at] ^= 0x55;
        let _ = schema("t.All", &damaged).learn(&first, 0..first.len());
        let _ = schema("t.All", &set[..at]).learn(&first, 0..first.len());
    }
}
