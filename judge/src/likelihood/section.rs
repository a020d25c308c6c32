//! The section of a result.

use super::Density;
use fusion::observe::{Entry, Figure, RunEnd, RunEvent, RunObserver, RunSection, RunStart, SectionColumn, SectionMaker, SectionObserver};
use fusion_core::health::State;
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};

fusion::inventory::submit! {
    SectionMaker { name: "likelihood", make: Likelihood::of }
}

/// The rows of a sensor.
#[derive(Clone, Debug, Default)]
struct Sum {
    rows: u64,
    nats: f64,
    density: Option<Density>,
    name: String,
}

/// The sums of the outermost filter, by sensor.
#[derive(Debug)]
struct Likelihood {
    sensors: Box<[Sum]>,
    has_aligned: bool,
}

// A run that resumes continues with them.
fusion_core::memory!(Sum { rows, nats; density, name });
fusion_core::memory!(Likelihood { sensors, has_aligned });

impl Likelihood {
    fn of(start: &RunStart<'_>) -> Option<Box<dyn SectionObserver>> {
        let sensors = super::densities(start.design).into_iter().zip(&start.design.sensors);
        let sensors = sensors.map(|(density, sensor)| Sum {
            density,
            name: sensor.name.clone(),
            ..Sum::default()
        });
        let sensors: Box<[Sum]> = sensors.collect();
        let has_any = sensors.iter().any(|sensor| sensor.density.is_some());
        has_any.then(|| -> Box<dyn SectionObserver> {
            Box::new(Self {
                sensors,
                has_aligned: false,
            })
        })
    }
}

impl RunObserver for Likelihood {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Filter { filter, event } = event else {
            return Ok(());
        };
        if !filter.is_outermost() {
            return Ok(());
        }
        match event {
            // Rows before the alignment count only if the filter never aligns.
            Event::Health { health } if health.state == State::Good && !self.has_aligned => {
                self.has_aligned = true;
                self.sensors.iter_mut().for_each(|sum| (sum.rows, sum.nats) = (0, 0.0));
            }
            Event::Updated { sensor, update, .. } => {
                let sum = &mut self.sensors[filter.sensors[*sensor].design];
                if let Some(log) = sum.density.and_then(|density| density.of_update(update)) {
                    sum.rows += 1;
                    sum.nats += log;
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }
}

impl SectionObserver for Likelihood {
    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let heard: Vec<&Sum> = self.sensors.iter().filter(|sum| sum.rows > 0).collect();
        let row = |name: &str, density: &str, rows: u64, nats: f64| {
            let figures = [Figure::Text(name.to_owned()), Figure::Text(density.to_owned())];
            let numbers = [Figure::Count(rows), Figure::Number(nats), Figure::Number(nats / rows as f64)];
            figures.into_iter().chain(numbers).collect::<Vec<_>>()
        };
        let of_sensor = |sum: &&Sum| row(&sum.name, sum.density.map_or("", |d| d.name()), sum.rows, sum.nats);
        let mut rows: Vec<_> = heard.iter().map(of_sensor).collect();
        if heard.len() > 1 {
            let (all, nats) = heard.iter().fold((0, 0.0), |(all, nats), sum| (all + sum.rows, nats + sum.nats));
            rows.push(row("all", "", all, nats));
        }
        let column = |name: &str| SectionColumn {
            name: name.to_owned(),
            unit: String::new(),
        };
        let since = if self.has_aligned {
            "from the alignment on"
        } else {
            "from the start on"
        };
        let section = RunSection {
            name: "likelihood".to_owned(),
            title: format!("Likelihood of innovations, {since}"),
            columns: ["sensor", "density", "rows", "ln L [nats]", "a row"].map(column).into(),
            rows,
            notes: Vec::new(),
            is_detail: true,
        };
        Ok(section.into())
    }
}
