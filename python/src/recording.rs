//! The results of a run in memory: estimates, innovations, errors, health.

use crate::arrays::Grid;
use fusion::assembly::Assembly;
use fusion::core::math;
use fusion::core::runner::{Event, Halt};
use fusion::design::Design;
use fusion::health::Names;
use fusion::models::earth::LocalFrame;
use fusion::observe::{Filters, Heard, RunEvent, RunObserver, Thinning};
use fusion::output::{Digits, EstimateCells, EstimateColumns, Origin, verdict_name};
use fusion::run::thinning;
use fusion::score::{Deviation, EpochError};
use std::collections::HashMap;

/// The estimates of a filter, a row for each, in SI with angles in radians.
#[derive(Debug)]
pub(crate) struct Estimates {
    columns: EstimateColumns,
    pub(crate) cells: Cells,
    thinning: Thinning,
}

/// The cells of estimates.
#[derive(Debug)]
pub(crate) struct Cells {
    pub(crate) rows: Grid,
    /// How a text shows each column.
    digits: Vec<Digits>,
    /// The columns that have a value in some row.
    pub(crate) filled: Vec<bool>,
    next: usize,
}

impl Estimates {
    fn new(filter: &Heard, origin: Origin, thinning: Thinning) -> Self {
        let columns = EstimateColumns::new(&filter.layout, origin);
        let width = columns.names().len();
        Self {
            columns,
            cells: Cells {
                rows: Grid::new(width),
                digits: vec![Digits::Fixed(0); width],
                filled: vec![false; width],
                next: 0,
            },
            thinning,
        }
    }

    /// The names of the columns, as in estimates.csv.
    pub(crate) fn names(&self) -> Vec<String> {
        self.columns.names()
    }

    /// The name, the number of values and the number of 1σ of each state behind the solution.
    pub(crate) fn further(&self) -> Vec<(String, usize, usize)> {
        let further = self.columns.further();
        further.map(|(name, values, sigmas)| (name.to_owned(), values, sigmas)).collect()
    }
}

impl Cells {
    /// The columns whose angles a text shows in degrees.
    pub(crate) fn in_degrees(&self) -> Vec<bool> {
        let is_angle = |digits: &Digits| matches!(digits, Digits::Degrees(_) | Digits::ScientificDegrees(_));
        self.digits.iter().map(is_angle).collect()
    }

    /// The numbers of estimates.csv for these rows.
    pub(crate) fn written(digits: &[Digits], rows: &[f64]) -> Grid {
        let mut all = Grid::new(digits.len());
        let cells = rows.iter().zip(digits.iter().cycle());
        all.extend(cells.map(|(number, digits)| digits.rounded(*number)));
        all
    }

    pub(crate) fn digits(&self) -> &[Digits] {
        &self.digits
    }
}

impl EstimateCells for Cells {
    fn number(&mut self, value: f64, digits: Digits) {
        self.digits[self.next] = digits;
        self.filled[self.next] |= !value.is_nan();
        self.next += 1;
        self.rows.push(value);
    }

    fn empty(&mut self, cells: usize) {
        self.next += cells;
        self.rows.extend(core::iter::repeat_n(f64::NAN, cells));
    }
}

/// The measurements of a sensor: time, NIS, statistic, threshold, weight, the number of the verdict, residuals, their 1σ.
#[derive(Debug)]
pub(crate) struct Innovations {
    pub(crate) name: String,
    pub(crate) rows: Grid,
}

/// A change of the health: time, state, and reasons with their subjects.
pub(crate) type Change = (f64, &'static str, Vec<String>);

/// Hears a run.
#[derive(Debug)]
pub(crate) struct Recording {
    pub(crate) estimates: Estimates,
    pub(crate) innovations: Vec<Innovations>,
    /// The numbers of the tables of innovations, by filter and sensor.
    places: HashMap<(usize, usize), usize>,
    pub(crate) verdicts: Vec<&'static str>,
    /// Time, then error and 1σ of position, velocity, attitude, three numbers each.
    pub(crate) errors: Grid,
    pub(crate) health: Vec<Change>,
    names: Names,
}

impl Recording {
    /// For a run, and for its smoothed estimates, in the same local coordinates.
    pub(crate) fn of(design: &Design, assembly: &Assembly) -> Option<(Self, Estimates)> {
        let filters = Filters::of(assembly);
        let outermost = filters.outermost()?;
        let declared = design.run.origin.map(|place| LocalFrame::new(place.into()));
        let origin = Origin::new(declared);
        let estimates = || Estimates::new(outermost, origin.clone(), thinning(design));
        let recording = Self {
            estimates: estimates(),
            innovations: Vec::new(),
            places: HashMap::new(),
            verdicts: Vec::new(),
            errors: Grid::new(1 + 6 * 3),
            health: Vec::new(),
            names: Names::new(outermost, assembly),
        };
        Some((recording, estimates()))
    }

    fn error(&mut self, error: &EpochError) {
        let three = |deviation: Option<&Deviation>| {
            let axes = |k: usize| {
                let known = deviation.filter(|deviation| deviation.known[k]);
                known.map_or([f64::NAN; 2], |d| [d.error[k], math::sqrt(d.own[(k, k)] + d.reference[(k, k)])])
            };
            let axes = [axes(0), axes(1), axes(2)];
            [0, 1].into_iter().flat_map(move |which| axes.map(|axis| axis[which]))
        };
        self.errors.push(error.truth.time.seconds());
        let attitude = error.attitude.as_ref().map(|attitude| &attitude.rpy);
        for deviation in [error.position.as_ref(), error.velocity.as_ref(), attitude] {
            self.errors.extend(three(deviation));
        }
    }
}

impl RunObserver for Estimates {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Estimate { filter, solution, belief } = event else {
            return Ok(());
        };
        if filter.is_outermost() && self.thinning.takes(belief.time) {
            self.cells.next = 0;
            self.columns.write(solution, belief, &mut self.cells);
        }
        Ok(())
    }
}

impl RunObserver for Recording {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Estimate { .. } => return self.estimates.on(event),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, .. },
            } => {
                let heard = &filter.sensors[*sensor];
                let place = *self.places.entry((filter.number, *sensor)).or_insert_with(|| {
                    self.innovations.push(Innovations {
                        name: heard.name.clone(),
                        rows: Grid::new(6 + 2 * heard.residual),
                    });
                    self.innovations.len() - 1
                });
                let word = verdict_name(update.verdict);
                let verdict = self.verdicts.iter().position(|known| *known == word).unwrap_or_else(|| {
                    self.verdicts.push(word);
                    self.verdicts.len() - 1
                });
                let rows = &mut self.innovations[place].rows;
                rows.extend([
                    time.seconds(),
                    update.nis,
                    update.statistic,
                    update.threshold,
                    update.weight,
                    verdict as f64,
                ]);
                for values in [update.residual, update.innovation_sigma] {
                    rows.extend((0..heard.residual).map(|k| values.get(k).copied().unwrap_or(f64::NAN)));
                }
            }
            RunEvent::Filter {
                filter,
                event: Event::Health { health },
            } if filter.is_outermost() => {
                let named = health.reasons.iter().map(|reason| self.names.of(*reason).to_string());
                self.health.push((health.since.seconds(), health.state.word(), named.collect()));
            }
            RunEvent::Reference {
                filter,
                error: Some(error),
                ..
            } if filter.is_outermost() => self.error(error),
            _ => {}
        }
        Ok(())
    }
}
