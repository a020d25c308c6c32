//! Mistakes in designs, and the exact messages for them.

use std::collections::BTreeMap;

use fusion_models::block::NestedBlock;
use fusion_models::units::{Axes, Length, NonNegative, Positive, Probability, dim};
use serde::Deserialize;

use super::{Diagnostics, Document, Node};

#[typetag::deserialize]
trait Gate: std::fmt::Debug {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only read")]
struct Nis {
    probability: Probability,
    #[serde(default)]
    recover_after: Option<u32>,
}

#[typetag::deserialize(name = "nis")]
impl Gate for Nis {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Open {}

#[typetag::deserialize(name = "none")]
impl Gate for Open {}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(dead_code, reason = "only read")]
enum Loss {
    Square,
    Huber { scale: f64 },
}

#[typetag::deserialize]
trait Sensor: std::fmt::Debug {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only read")]
struct Gnss {
    sigma: Axes<dim::Length>,
    latency: NonNegative<dim::Duration>,
    #[serde(default)]
    mast: Length,
    #[serde(default)]
    rate: Option<Positive<dim::Frequency>>,
    #[serde(default)]
    gate: Option<NestedBlock<dyn Gate>>,
    #[serde(default)]
    loss: Option<Loss>,
}

#[typetag::deserialize(name = "gnss_position")]
impl Sensor for Gnss {}

const SENSORS: [&str; 2] = ["gnss_position", "gnss_velocity"];

/// Every mistake found in `text`, where `sensor.gnss` is a sensor, changed by `--set` arguments.
fn complaints_after(sets: &[&str], text: &str) -> String {
    let (mut document, found) = Document::parse("filter.toml", text);
    let mut diagnostics = Diagnostics::new();
    diagnostics.extend(found);
    for set in sets {
        diagnostics.keep(document.set(set));
    }
    if !diagnostics.has_errors() {
        let read = read(document.root().at("sensor.gnss").unwrap(), &mut diagnostics);
        assert_eq!(read.is_some(), diagnostics.is_empty());
    }
    diagnostics.to_string()
}

fn read(node: &Node, diagnostics: &mut Diagnostics) -> Option<Box<dyn Sensor>> {
    node.read_block("sensor", &SENSORS, diagnostics)
}

/// The messages for a sensor that is correct except for `line`, its fifth line.
fn complaints(line: &str) -> String {
    complaints_after(&[], &format!("{SENSOR}{line}\n"))
}

const SENSOR: &str = "\
[sensor.gnss]
type = 'gnss_position'
sigma = '2 m'
latency = '50 ms'
";

#[test]
fn what_is_right_is_read_without_a_word() {
    let lines = [
        "mast = '5 cm'",
        "gate = { probability = 0.99, type = 'nis' }",
        "gate = { type = 'none' }",
        "gate = 'none'",
        "loss = { scale = 1.5, type = 'huber' }",
        "loss = { type = 'square' }",
        "loss = 'square'",
        "[sensor.gnss.gate]\nprobability = '99 %'\ntype = 'nis'",
    ];
    for line in lines {
        assert_eq!(complaints(line), "", "{line}");
    }
}

#[test]
fn a_plain_map_may_have_a_key_named_type() {
    let (document, _) = Document::parse("filter.toml", "type = 1\nother = 2\n");
    let map = document.root().read::<BTreeMap<String, i64>>(&mut Diagnostics::new()).unwrap();
    assert_eq!(map.len(), 2);
}

#[test]
fn an_unknown_field_is_underlined_and_the_one_meant_is_named() {
    let expected = "\
error: unknown field `mats`
 --> filter.toml:5:1
  |
5 | mats = 1
  | ^^^^ did you mean `mast`?
  |
  = help: known fields: `sigma`, `latency`, `mast`, `rate`, `gate`, `loss`";
    assert_eq!(complaints("mats = 1"), expected);
}

#[test]
fn a_field_read_elsewhere_is_still_suggested() {
    let (document, _) = Document::parse("filter.toml", &format!("{SENSOR}nosie = 1\n"));
    let mut sensor = document.root().at("sensor.gnss").unwrap().clone();
    let common = sensor.split_off(&["noise", "source"]);
    assert!(common.entries().is_empty());
    let mut diagnostics = Diagnostics::new();
    assert!(read(&sensor, &mut diagnostics).is_none());
    assert!(diagnostics.to_string().contains("did you mean `noise`?"), "{diagnostics}");
}

#[test]
fn a_value_of_the_wrong_type_is_underlined() {
    let expected = r#"error: expected a length [m], e.g. "0.5 m", found `true`
 --> filter.toml:5:8
  |
5 | mast = true
  |        ^^^^"#;
    assert_eq!(complaints("mast = true"), expected);
}

#[test]
fn a_quantity_of_the_wrong_dimension_names_both() {
    let expected = r#"error: "5 deg" is an angle [rad]; a length [m] is expected here, e.g. "0.5 m"
 --> filter.toml:5:8
  |
5 | mast = '5 deg'
  |        ^^^^^^^"#;
    assert_eq!(complaints("mast = '5 deg'"), expected);
}

#[test]
fn an_unknown_unit_suggests_a_known_one() {
    let expected = r#"error: unknown unit `meters` in "5 meters"; a length [m] is expected here, e.g. "0.5 m"; did you mean `m`?
 --> filter.toml:5:8
  |
5 | mast = '5 meters'
  |        ^^^^^^^^^^"#;
    assert_eq!(complaints("mast = '5 meters'"), expected);
}

#[test]
fn a_value_out_of_range_is_told_the_range() {
    let expected = r#"error: "-1 Hz" is out of range; a frequency [Hz] greater than 0 is expected here, e.g. "100 Hz"
 --> filter.toml:5:8
  |
5 | rate = '-1 Hz'
  |        ^^^^^^^"#;
    assert_eq!(complaints("rate = '-1 Hz'"), expected);
}

#[test]
fn what_a_conversion_refuses_is_underlined() {
    #[derive(Debug, Deserialize)]
    #[serde(try_from = "i64")]
    struct Even;

    impl TryFrom<i64> for Even {
        type Error = String;

        fn try_from(number: i64) -> Result<Self, String> {
            (number % 2 == 0).then_some(Self).ok_or_else(|| format!("{number} is odd"))
        }
    }

    let (document, _) = Document::parse("filter.toml", "a = [2, 3]\nb = [4, 5]\n");
    let mut diagnostics = Diagnostics::new();
    assert!(document.root().read::<BTreeMap<String, Vec<Even>>>(&mut diagnostics).is_none());
    let expected = "\
error: 3 is odd
 --> filter.toml:1:9
  |
1 | a = [2, 3]
  |         ^

error: 5 is odd
 --> filter.toml:2:9
  |
2 | b = [4, 5]
  |         ^";
    assert_eq!(diagnostics.to_string(), expected);
}

#[test]
fn a_missing_field_is_missed_where_its_table_is_named() {
    let expected = "\
error: missing field `probability`
 --> filter.toml:5:14
  |
5 | [sensor.gnss.gate]
  |              ^^^^ needs `probability`";
    assert_eq!(complaints("[sensor.gnss.gate]\ntype = 'nis'"), expected);
}

#[test]
fn an_unknown_type_of_block_lists_the_known_ones() {
    let expected = "\
error: unknown sensor `gnss_posiion`
 --> filter.toml:3:8
  |
3 | type = 'gnss_posiion'
  |        ^^^^^^^^^^^^^^ did you mean `gnss_position`?
  |
  = help: known types: `gnss_position`, `gnss_velocity`";
    let text = "\n[sensor.gnss]\ntype = 'gnss_posiion'\nsgima = 1\n";
    assert_eq!(complaints_after(&[], text), expected);
}

#[test]
fn a_block_without_a_type_is_asked_for_one() {
    let outer = "\
error: this sensor has no `type`
 --> filter.toml:1:9
  |
1 | [sensor.gnss]
  |         ^^^^
  |
  = help: known types: `gnss_position`, `gnss_velocity`";
    assert_eq!(complaints_after(&[], "[sensor.gnss]\n"), outer);
    let nested = "\
error: missing field `type`
 --> filter.toml:5:1
  |
5 | gate = { probability = 1 }
  | ^^^^ needs `type`
  |
  = help: known types: `nis`, `none`";
    assert_eq!(complaints("gate = { probability = 1 }"), nested);
}

#[test]
fn a_nested_block_and_an_enum_report_like_any_other() {
    let unknown = "\
error: unknown name `nsi`
 --> filter.toml:5:17
  |
5 | gate = { type = 'nsi' }
  |                 ^^^^^ did you mean `nis`?
  |
  = help: known: `nis`, `none`";
    assert_eq!(complaints("gate = { type = 'nsi' }"), unknown);
    let misread = "\
error: expected a number, found the text \"x\"
 --> filter.toml:5:34
  |
5 | loss = { type = 'huber', scale = 'x' }
  |                                  ^^^";
    assert_eq!(complaints("loss = { type = 'huber', scale = 'x' }"), misread);
    let superfluous = complaints("loss = { type = 'square', scale = 1 }");
    assert!(superfluous.starts_with("error: unknown field `scale`\n --> filter.toml:5:27"));
}

#[test]
fn all_mistakes_of_a_table_are_found_in_one_run() {
    let text = "\
[sensor.gnss]
type = 'gnss_position'
sigma = [1, '2 x', '3 s']
latncy = 0
gate = { type = 'nis', prob = 2, recover_after = -1 }
loss = 'hubber'
";
    let expected = r#"error: unknown unit `x` in "2 x"; a length [m] is expected here, e.g. "0.5 m"
 --> filter.toml:3:13
  |
3 | sigma = [1, '2 x', '3 s']
  |             ^^^^^

error: "3 s" is a duration [s]; a length [m] is expected here, e.g. "0.5 m"
 --> filter.toml:3:20
  |
3 | sigma = [1, '2 x', '3 s']
  |                    ^^^^^

error: unknown field `latncy`
 --> filter.toml:4:1
  |
4 | latncy = 0
  | ^^^^^^ did you mean `latency`?
  |
  = help: known fields: `sigma`, `latency`, `mast`, `rate`, `gate`, `loss`

error: unknown field `prob`
 --> filter.toml:5:24
  |
5 | gate = { type = 'nis', prob = 2, recover_after = -1 }
  |                        ^^^^ did you mean `probability`?
  |
  = help: known fields: `probability`, `recover_after`

error: expected a whole number of at least 0, found the integer `-1`
 --> filter.toml:5:50
  |
5 | gate = { type = 'nis', prob = 2, recover_after = -1 }
  |                                                  ^^

error: unknown name `hubber`
 --> filter.toml:6:8
  |
6 | loss = 'hubber'
  |        ^^^^^^^^ did you mean `huber`?
  |
  = help: known: `square`, `huber`"#;
    assert_eq!(complaints_after(&[], text), expected);
}

#[test]
fn two_syntax_errors_are_both_reported() {
    let expected = "\
error: extra `=`, expected nothing
 --> filter.toml:5:8
  |
5 | rate = = 5
  |        ^

error: invalid literal string, expected `'`
 --> filter.toml:7:10
  |
7 | loss = 'x
  |          ^";
    assert_eq!(complaints("rate = = 5\nmast = 1\nloss = 'x"), expected);
}

#[test]
fn a_mistake_in_an_override_points_into_the_argument() {
    let expected = r#"error: "5 deg" is an angle [rad]; a length [m] is expected here, e.g. "0.5 m"
 --> command line:1:24
  |
1 | --set sensor.gnss.mast=5 deg
  |                        ^^^^^"#;
    assert_eq!(complaints_after(&["sensor.gnss.mast=5 deg"], SENSOR), expected);
    let expected = "\
error: unknown field `mats`
 --> command line:1:19
  |
1 | --set sensor.gnss.mats=1
  |                   ^^^^ did you mean `mast`?
  |
  = help: known fields: `sigma`, `latency`, `mast`, `rate`, `gate`, `loss`";
    assert_eq!(complaints_after(&["sensor.gnss.mats=1"], SENSOR), expected);
}

#[test]
fn an_override_that_leads_nowhere_says_where_it_stopped() {
    let expected = "\
error: there is no `mean` here
 --> command line:1:25
  |
1 | --set sensor.gnss.sigma.mean=1
  |                         ^^^^
  |
  = help: this is a single value, with nothing in it";
    assert_eq!(complaints_after(&["sensor.gnss.sigma.mean=1"], SENSOR), expected);
}

#[test]
fn a_malformed_override_is_refused() {
    let expected = "\
error: unclosed array, expected `]`
 --> command line:1:27
  |
1 | --set sensor.gnss.mast=[1,
  |                           ^

error: `--set` takes `path=value`
 --> command line:1:7
  |
1 | --set sensor.gnss.mast
  |       ^^^^^^^^^^^^^^^^

error: `--set` takes `path=value`
 --> command line:1:7
  |
1 | --set sensor.gnss.mast=
  |       ^^^^^^^^^^^^^^^^^ a value is missing after `=`";
    let sets = ["sensor.gnss.mast=[1,", "sensor.gnss.mast", "sensor.gnss.mast="];
    assert_eq!(complaints_after(&sets, SENSOR), expected);
}
