//! The filters that are observed: the filter of a design, and the filters inside its stages.

use crate::assembly::{Assembly, Inside, SensorInfo};
use core::ops::Range;
use fusion_core::model::Process;
use fusion_core::runner::{Event, Sensor, StreamId};
use fusion_core::state::Layout;
use fusion_models::block::Shape;
use fusion_models::units::Dimension;
use std::sync::Arc;

/// A filter that is observed.
#[derive(Debug)]
pub struct Heard {
    /// Its number among the filters of the design; the outermost is 0.
    pub number: usize,
    /// The stages around it, from the outermost; empty for the filter of the design.
    pub stages: Vec<String>,
    /// Its state layout.
    pub layout: Arc<Layout>,
    /// Its process model.
    pub process: Arc<dyn Process>,
    /// Its sensors, in order of their numbers.
    pub sensors: Vec<HeardSensor>,
    /// The number of its first sensor among those of all filters.
    pub first_sensor: usize,
    /// The filters inside its stages: the stage's name and the filter's number.
    inside: Vec<(String, usize)>,
}

/// A sensor that is observed.
#[derive(Clone, Debug)]
pub struct HeardSensor {
    /// Its name after the name of its filter: `stage.sensor`.
    pub name: String,
    /// The number of the sensor in the design. The parts of a sensor, such as the beams of a DVL, have the same number.
    pub design: usize,
    /// Dimension of each residual row.
    pub rows: Vec<Dimension>,
    /// Name of each residual row; empty if they have no names.
    pub axes: &'static [&'static str],
    /// The number of residual rows.
    pub residual: usize,
    /// True if it measures a place: latitude, longitude, height.
    pub is_place: bool,
    /// Its stream, and the columns that it reads: its channel, and the 1σ that the row contains.
    pub reads: (StreamId, Vec<usize>),
}

impl HeardSensor {
    fn new(name: String, reads: (StreamId, Vec<usize>), info: &SensorInfo) -> Self {
        Self {
            name,
            design: info.design,
            rows: info.rows.clone(),
            axes: info.axes,
            residual: info.model.size().residual,
            is_place: matches!(&info.channels[..], [c] if c.shape == Shape::Geodetic),
            reads,
        }
    }

    /// Returns true if it reads any of these columns of a stream.
    #[must_use]
    pub(crate) fn reads_any(&self, stream: StreamId, columns: &Range<usize>) -> bool {
        stream == self.reads.0 && self.reads.1.iter().any(|c| columns.contains(c))
    }
}

impl Heard {
    /// A name inside this filter, after the names of the stages around it: `stage.own`.
    #[must_use]
    pub fn named(&self, own: &str) -> String {
        let mut name = String::new();
        self.stages.iter().for_each(|stage| name.extend([stage, "."]));
        name + own
    }

    /// Returns true if it is the filter of the design itself.
    #[must_use]
    pub fn is_outermost(&self) -> bool {
        self.stages.is_empty()
    }
}

/// All filters of a design, the outermost first.
#[derive(Debug)]
pub struct Filters(Vec<Heard>);

impl Filters {
    /// The filters of an assembly.
    #[must_use]
    pub fn of(assembly: &Assembly) -> Self {
        let mut filters = Self(Vec::new());
        let sensors = assembly.runner.sensors().iter().map(Sensor::reads);
        let number = filters.add(None, (&assembly.layout, &assembly.process), sensors, &assembly.sensors);
        filters.add_inside(number, &assembly.filters);
        filters
    }

    /// Adds the filters inside the stages of the filter `around`, each followed by the filters inside it.
    fn add_inside(&mut self, around: usize, inside: &[Inside]) {
        for filter in inside {
            let models = (&filter.layout, &filter.process);
            let number = self.add(Some((around, &filter.name)), models, filter.reads.iter().cloned(), &filter.sensors);
            self.add_inside(number, &filter.filters);
        }
    }

    /// Adds one filter. For a filter inside a stage, `stage` is the number of the filter around it and the stage's
    /// name.
    fn add(
        &mut self,
        stage: Option<(usize, &str)>,
        (layout, process): (&Arc<Layout>, &Arc<dyn Process>),
        sensors: impl Iterator<Item = (StreamId, Vec<usize>)>,
        infos: &[SensorInfo],
    ) -> usize {
        let number = self.0.len();
        let mut stages = stage.map_or_else(Vec::new, |(around, _)| self.0[around].stages.clone());
        stages.extend(stage.map(|(_, name)| name.to_owned()));
        let mut heard = Heard {
            number,
            stages,
            layout: layout.clone(),
            process: process.clone(),
            sensors: Vec::new(),
            first_sensor: self.sensors().count(),
            inside: Vec::new(),
        };
        let named = sensors.zip(infos);
        heard.sensors = named
            .map(|(reads, info)| HeardSensor::new(heard.named(&info.name), reads, info))
            .collect();
        self.0.push(heard);
        if let Some((around, name)) = stage {
            self.0[around].inside.push((name.to_owned(), number));
        }
        number
    }

    /// The filter of the design itself.
    #[must_use]
    pub fn outermost(&self) -> Option<&Heard> {
        self.0.first()
    }

    /// The filters, in order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = &Heard> {
        self.0.iter()
    }

    /// The sensors of all filters: those of the outermost first.
    pub fn sensors(&self) -> impl Iterator<Item = &HeardSensor> {
        self.0.iter().flat_map(|filter| &filter.sensors)
    }

    /// The filter that reported an event, and the event itself. `None` if a stage reports a filter that the design does
    /// not have.
    #[must_use]
    pub fn source<'e>(&self, event: &'e Event<'e>) -> Option<(&Heard, &'e Event<'e>)> {
        let (mut filter, mut event) = (self.0.first()?, event);
        while let Event::Nested { stage, event: told } = event {
            let (_, number) = filter.inside.iter().find(|(name, _)| name == stage)?;
            (filter, event) = (self.0.get(*number)?, *told);
        }
        Some((filter, event))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::{Failures, Hub, UnusedRows};
    use fusion_core::filter::FilterError;
    use fusion_core::runner::{Discard, Observer, RowId};
    use fusion_core::time::Time;

    #[test]
    fn what_a_filter_inside_a_stage_tells_is_counted_under_the_names_of_its_stages() {
        let design = "
            [process]
            type = 'constant_velocity'
            acceleration_noise = 1
            position_sigma = 10
            velocity_sigma = 5
            [sensor.height]
            type = 'height'
            source = 'baro'
            noise = { sigma = 1 }
            [initial.start]
            type = 'explicit'
            position = { latitude = 0.8, longitude = 0.1 }
            position_sigma = 5
            velocity = [0, 0, 0]
            velocity_sigma = 1
            [run]
            origin = { latitude = 0.8, longitude = 0.1 }";
        let nav = crate::Navigator::from_toml(design).unwrap_or_else(|d| panic!("{d}"));
        let assembly = nav.assembly();
        let mut filters = Filters::of(assembly);
        for (around, stage) in [(0, "outer"), (1, "inner")] {
            let models = (&assembly.layout, &assembly.process);
            let reads = assembly.runner.sensors().iter().map(Sensor::reads);
            let number = filters.add(Some((around, stage)), models, reads, &assembly.sensors);
            assert_eq!(number, around + 1);
        }
        let names: Vec<&str> = filters.sensors().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["height", "outer.height", "outer.inner.height"]);
        assert_eq!(filters.iter().map(|f| f.first_sensor).collect::<Vec<_>>(), [0, 1, 2]);
        let (mut unused, mut failures) = (UnusedRows::default(), Failures::default());
        let mut hub = Hub::new(&filters, None);
        hub.add(&mut unused);
        hub.add(&mut failures);
        let row = RowId {
            stream: 0,
            number: 0,
            stamp: Time::default(),
            arrival: Time::default(),
            disturbed: false,
        };
        let late = Event::Discarded {
            consumer: "height",
            input: 0,
            time: Time::default(),
            row,
            why: Discard::NotFinite,
        };
        let failed = Event::Failed {
            error: FilterError::Diverged(Time::default()),
        };
        for told in [&late, &failed] {
            let event = &Event::Nested {
                stage: "inner",
                event: told,
            };
            hub.on(&Event::Nested { stage: "outer", event }).unwrap();
            hub.on(told).unwrap();
            // An unknown stage is ignored.
            hub.on(&Event::Nested {
                stage: "inner",
                event: told,
            })
            .unwrap();
        }
        drop(hub);
        let why = FilterError::Diverged(Time::default());
        let counted = [("outer.inner.height".to_owned(), 1), ("height".to_owned(), 1)];
        assert_eq!(unused.by_consumer, counted);
        assert_eq!(failures.first, [format!("outer.inner: {why}"), why.to_string()]);
        assert_eq!(failures.further, 0);
        // Failures after the tenth are counted.
        let mut hub = Hub::new(&filters, None);
        hub.add(&mut failures);
        for _ in 0..11 {
            hub.on(&failed).unwrap();
        }
        drop(hub);
        assert_eq!((failures.first.len(), failures.further), (10, 3));
    }
}
