//! The sensors of a filter by their names.

use fusion::assembly::SensorInfo;
use fusion::config::Diagnostic;
use fusion::design::Design;

/// A sensor of the filter.
#[derive(Debug)]
pub(super) struct Sensor {
    pub(super) name: String,
    /// Its name in the design. The parts of a sensor, such as the beams of a DVL, have the same.
    declared: String,
    pub(super) is_constraint: bool,
}

impl Sensor {
    pub(super) fn of(info: &SensorInfo, design: &Design) -> Self {
        Self {
            name: info.name.clone(),
            declared: design.sensors[info.design].name.clone(),
            is_constraint: info.channels.is_empty(),
        }
    }
}

/// The numbers of the sensors with these names.
pub(super) fn numbers(sensors: &[Sensor], names: &[String]) -> Result<Vec<usize>, Diagnostic> {
    let mut numbers = Vec::new();
    for name in names {
        let before = numbers.len();
        let is_it = |sensor: &Sensor| sensor.name == *name || sensor.declared == *name;
        numbers.extend((0..sensors.len()).filter(|number| is_it(&sensors[*number])));
        if numbers.len() == before {
            let known: Vec<&str> = sensors.iter().map(|sensor| &*sensor.name).collect();
            let unknown = Diagnostic::error(format!("no sensor of the filter is called `{name}`"));
            return Err(unknown.suggest(name, &known, "there are"));
        }
    }
    Ok(numbers)
}
