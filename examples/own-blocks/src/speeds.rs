//! A section of the result: the speeds of a run, by the estimate of the outermost filter.
//!
//! Not here: speeds before the filter starts, and the uncertainty of a speed

use fusion::core::runner::Halt;
use fusion::core::state::{Manifold, Velocity};
use fusion::models::vocabulary::state;
use fusion::observe::{Entry, Figure, RunEnd, RunEvent, RunObserver, RunSection, Section, SectionColumn, SectionMaker, SectionObserver};

fusion::inventory::submit! {
    SectionMaker { name: "speeds", make: |_start| Some(Box::new(Watch::default())) }
}

/// The section: horizontal and vertical speeds.
#[derive(Debug, Default, serde::Serialize)]
pub struct Speeds {
    /// Mean \[m/s\].
    pub mean: [f64; 2],
    /// Largest \[m/s\].
    pub largest: [f64; 2],
    /// When they were largest \[s\].
    pub at: [f64; 2],
}

impl Section for Speeds {
    const NAME: &'static str = "speeds";

    fn shown(&self) -> Option<RunSection> {
        let column = |name: &str, unit: &str| SectionColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
        };
        let row = |(k, name): (usize, &str)| {
            let numbers = [self.mean[k], self.largest[k], self.at[k]].map(Figure::Number);
            [Figure::Text(name.to_owned())].into_iter().chain(numbers).collect()
        };
        Some(RunSection {
            name: Self::NAME.to_owned(),
            title: "Speeds".to_owned(),
            columns: vec![
                column("direction", ""),
                column("mean", "m/s"),
                column("largest", "m/s"),
                column("at", "s"),
            ],
            rows: ["horizontal", "vertical"].into_iter().enumerate().map(row).collect(),
            ..RunSection::default()
        })
    }
}

/// The observer.
#[derive(Debug, Default)]
struct Watch {
    count: u64,
    sums: [f64; 2],
    largest: [f64; 2],
    at: [f64; 2],
}
// A run that resumes continues with them.
fusion::core::memory!(Watch { count, sums, largest, at });

impl RunObserver for Watch {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Estimate { filter, belief, .. } = event else {
            return Ok(());
        };
        let velocity = filter.layout.block(state::VELOCITY).filter(|b| b.kind == Velocity::KIND);
        let Some(block) = velocity.filter(|_| filter.is_outermost()) else {
            return Ok(());
        };
        let v = Velocity::read(&belief.x[block.storage_range()]);
        self.count += 1;
        for (k, speed) in [v.x.hypot(v.y), v.z.abs()].into_iter().enumerate() {
            self.sums[k] += speed;
            if speed > self.largest[k] {
                (self.largest[k], self.at[k]) = (speed, belief.time.seconds());
            }
        }
        Ok(())
    }

    fn memory(&mut self) -> Option<&mut dyn fusion::core::memory::Memory> {
        Some(self)
    }
}

impl SectionObserver for Watch {
    fn finish(self: Box<Self>, _end: &RunEnd<'_>) -> Result<Entry, Halt> {
        let speeds = Speeds {
            mean: self.sums.map(|sum| sum / self.count as f64),
            largest: self.largest,
            at: self.at,
        };
        Ok(speeds.into())
    }
}
