//! A stage that is a design: `[stage.NAME]` with `type = "filter"`.

use super::read::{Draft, Optional};
use super::{RunSpec, names};
use crate::config::{Diagnostics, Document, Node};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value};

/// The `type` of a stage that is a design.
const FILTER: &str = "filter";

/// Tables that a filter inside a stage may have.
pub(crate) const TABLES: [&str; 6] = ["filter", "health", "process", "sensor", "stage", "initial"];

/// A separate filter: a design inside a design.
///
/// It reads sources and stages outside, and stages inside. It uses the origin of the run. After each
/// row that moves its process it emits its states, each with its 1σ as `NAME_sigma`. It also emits
/// the signals of its process and the other channels of the driving row. With an attitude it emits
/// `heading`, `heading_sigma` and `tilt_sigma` too. Its results are reported under the name of the
/// stage.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
#[expect(dead_code, reason = "it is read table by table, as any design; this describes the tables")]
struct FilterStageSpec {
    /// The backend.
    filter: Option<Map<String, Value>>,
    /// The limits for its health.
    health: Option<Map<String, Value>>,
    /// The process model and its source.
    process: Map<String, Value>,
    /// Measurement models by name, each with its source and noise.
    sensor: Option<Map<String, Value>>,
    /// Stages by name; they may be filters in turn.
    stage: Option<Map<String, Value>>,
    /// Initialisers by name.
    initial: Option<Map<String, Value>>,
}

fusion_models::register!(
    Stage,
    "filter",
    FilterStageSpec,
    r#"
process = { type = "attitude_only", source = "imu", gyro_noise = "0.1 deg/sqrt(s)" }
sensor.vertical = { type = "gravity_direction", source = "imu", noise = { sigma = "0.5 m/s^2" } }
initial.level = { type = "levelling", source = "imu", duration = "1 s", tilt_sigma = "2 deg" }
"#
);

/// Whether a stage is a design.
pub(super) fn is_filter(stage: &Node) -> bool {
    stage.as_str().or_else(|| stage.get("type")?.as_str()) == Some(FILTER)
}

/// Reads a stage that is a design, of a run.
pub(super) fn read(stage: &Node, document: &Document, run: &RunSpec, d: &mut Diagnostics) -> Option<Optional<Draft>> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Common {
        #[serde(rename = "type")]
        _type: Option<String>,
        enabled: Option<bool>,
    }
    let mut own = stage.clone();
    let common: Option<Common> = own.split_off(&["type", "enabled"]).read(d);
    names::check_tables(&own, &TABLES, d);
    let run = RunSpec {
        // The runner outside has put the rows in order.
        reorder: Default::default(),
        ..run.clone()
    };
    let block = Draft::filter(document.within(own), run, d);
    let enabled = common?.enabled != Some(false);
    Some(Optional { enabled, block })
}

#[cfg(test)]
mod tests {
    use crate::assembly::{assemble, declared_streams};
    use crate::config::Document;
    use crate::design::Design;
    use fusion_core::runner::{Discard, Event, Row};
    use fusion_core::time::Time;

    const CASCADE: &str = r#"
[run]
origin = { latitude = "35 deg", longitude = "129 deg", height = 0 }
[process]
type = "strapdown_external_attitude"
source = "attitude"
attitude_noise = 1e-5
accelerometer_noise = 1e-4
[stage.attitude]
type = "filter"
process = { type = "attitude_only", source = "imu", gyro_noise = 1e-4 }
initial.level = { type = "levelling", source = "imu", duration = 1, tilt_sigma = 0.01 }
sensor.tilt = { type = "gravity_direction", source = "imu", noise = { sigma = 0.5 } }
[initial.start]
type = "explicit"
position = { latitude = "35 deg", longitude = "129 deg", height = 0 }
position_sigma = 1
velocity = [0, 0, 0]
velocity_sigma = 1
attitude = [0, 0, 0]
attitude_sigma = 0.1
[sensor.attitude]
type = "attitude"
source = "attitude"
noise = { from_source = true }
"#;

    fn mistakes(design: &str) -> String {
        let (document, errors) = Document::parse("x.toml", design);
        assert!(errors.is_empty(), "{errors:?}");
        match crate::run::examine::build(document) {
            Ok(_) => String::new(),
            Err(mistakes) => mistakes.to_string(),
        }
    }

    #[test]
    fn a_filter_inside_drives_the_process_outside_and_lends_it_its_sigma() {
        let (document, _) = Document::parse("x.toml", CASCADE);
        let design = Design::read(document).unwrap_or_else(|d| panic!("{d}"));
        let assembly = assemble(&design, declared_streams(&design).unwrap()).unwrap_or_else(|d| panic!("{d}"));
        let mut runner = assembly.runner;
        // A program feeds it: the stream has the channels that the filter inside reads.
        let imu = runner.stream("imu").unwrap();
        assert_eq!(runner.streams().nth(imu).unwrap().1, 6);
        let (mut inside, mut outside) = (0, Vec::new());
        for k in 0..500_u32 {
            let row = [0.0, 0.0, 0.0, 0.0, 0.0, -9.8];
            let mut observer = |event: &Event<'_>| match event {
                Event::Nested {
                    stage: "attitude",
                    event: Event::Updated { .. },
                } => inside += 1,
                Event::Updated { update, .. } => outside.push(update.noise[0].sqrt()),
                Event::Discarded {
                    consumer,
                    time,
                    why: Discard::Late { .. },
                    ..
                } => panic!("{consumer} at {time} is late"),
                _ => {}
            };
            runner
                .feed(&Row::new(imu, Time::from_seconds(f64::from(k) * 0.01), &row), &mut observer)
                .unwrap();
        }
        // 5 s less the second of levelling; the first row opens the interval of the process outside.
        assert_eq!(inside, 399);
        assert_eq!(outside.len(), 398);
        // The σ of the tilt inside falls from 0.01 rad; 0.5/9.8/√399 is what the verticals alone give.
        let (first, last) = (outside[0], outside[397]);
        assert!(first < 0.0101 && last < 0.0026 && last > 0.0020, "{first} {last}");
    }

    #[test]
    fn mistakes_inside_a_filter_are_shown_at_their_places() {
        assert_eq!(mistakes(CASCADE), "");
        for (right, wrong, told) in [
            (
                "process = { type = \"attitude_only\", ",
                "proces = { type = \"attitude_only\", ",
                "unknown table `proces`",
            ),
            ("tilt_sigma = 0.01", "tilt_sigma = \"1 m\"", "x.toml:12:"),
            (
                "source = \"imu\", noise",
                "source = \"attitude\", noise",
                "which is itself or is declared after it",
            ),
        ] {
            assert!(CASCADE.contains(right), "{right}");
            let told_of = mistakes(&CASCADE.replacen(right, wrong, 1));
            assert!(told_of.contains(told), "{wrong}: {told_of}");
        }
    }

    #[test]
    fn a_stage_inside_does_not_bear_the_name_of_a_source_outside() {
        let source = "[source.imu]\ntype = \"csv\"\npath = \"x.csv\"\ntime = { column = \"t\" }\n[source.imu.channels]\n\
            angular_rate = { columns = [\"a\", \"b\", \"c\"], unit = \"rad/s\" }\n\
            specific_force = { columns = [\"d\", \"e\", \"f\"], unit = \"m/s^2\" }\n";
        let inside = "stage.imu = { type = \"steady_force\", source = \"imu\", time_constant = 1 }\n[initial.start]";
        let told = mistakes(&(CASCADE.replacen("[initial.start]", inside, 1) + source));
        assert!(
            told.contains("`imu` is the name of a source or stage outside this filter"),
            "{told}"
        );
    }
}
