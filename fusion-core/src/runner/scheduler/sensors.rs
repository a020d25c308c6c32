//! The sensors: their ranks, their latest outcomes, and the offer of a measurement.

use crate::filter::{Estimator, Lateness, Observed, Verdict};
use crate::gate::Outcome;
use crate::memory::{Memory, Tape};
use crate::model::Input;
use crate::runner::consumer::Delays;
use crate::runner::rows::Stored;
use crate::runner::{Discard, Event, Halt, Observer, RowId, Sensor};
use crate::time::Time;
use alloc::vec::Vec;

/// A measurement: when it is valid, its sensor, the number of its row in the queue, and the factor on its 1σ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Waiting {
    pub(crate) time: Time,
    pub(crate) sensor: usize,
    pub(crate) row: usize,
    pub(crate) noise: f64,
}
crate::memory!(Waiting { time, sensor, row, noise });

/// How the latest rows of its [`Switch`](crate::runner::Switch) set a sensor.
#[derive(Clone, Copy, Debug)]
struct Setting {
    is_used: bool,
    /// The factor on the 1σ of its noise.
    noise: f64,
}
crate::memory!(Setting { is_used, noise });

impl Default for Setting {
    fn default() -> Self {
        Self { is_used: true, noise: 1.0 }
    }
}

/// The knowledge of the other parts of the runner about a measurement.
#[derive(Debug, Default)]
pub(crate) struct Circumstances<'a> {
    /// The current sample of the input as it was expected, in which the model is differentiated.
    pub(crate) expected: Option<Input<'a>>,
    /// The offset by which its row is valid at its time, and the input about that time. `None` without an offset, and
    /// where the input is unknown.
    pub(crate) shift: Option<(f64, Input<'a>)>,
    /// The outcome of its leader, if the leader is served later.
    pub(crate) foreseen: Option<Outcome>,
}

/// The sensors, in order of their numbers.
#[derive(Debug, Default)]
pub(super) struct Sensors {
    units: Vec<Sensor>,
    /// The length of its chain of leaders, including itself. At the same time, lower ranks are served first.
    ranks: Vec<usize>,
    /// The outcome of its latest measurement.
    outcomes: Vec<Option<Outcome>>,
    settings: Vec<Setting>,
    value: Vec<f64>,
    noise: Vec<f64>,
}

impl Memory for Sensors {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.units.iter_mut().for_each(|sensor| sensor.gate.remember(tape));
        self.outcomes.as_mut_slice().remember(tape);
        self.settings.as_mut_slice().remember(tape);
    }
}

impl Sensors {
    /// Adds a sensor.
    pub(super) fn add(&mut self, sensor: Sensor) {
        let m = sensor.model.size().residual;
        if self.noise.len() < m * m {
            self.noise.resize(m * m, 0.0);
        }
        // The buffer is empty: room for the first measurement.
        self.value.reserve(sensor.port.columns.len().max(sensor.constant.len()));
        self.units.push(sensor);
        self.outcomes.push(None);
        self.settings.push(Setting::default());
        // `take` ends a cycle.
        let all = self.units.len();
        let rank = |s| core::iter::successors(Some(s), |&s| self.leader(s)).take(all).count();
        self.ranks = (0..all).map(rank).collect();
    }

    pub(super) fn units(&self) -> &[Sensor] {
        &self.units
    }

    /// The rank of a sensor; `None` if there is no such sensor.
    pub(super) fn rank(&self, sensor: usize) -> Option<usize> {
        self.ranks.get(sensor).copied()
    }

    /// The leader of a sensor.
    pub(super) fn leader(&self, sensor: usize) -> Option<usize> {
        self.units[sensor].gate.leader().filter(|&leader| leader < self.units.len())
    }

    /// The outcome of the latest measurement of a sensor.
    pub(super) fn outcome(&self, sensor: usize) -> Option<Outcome> {
        self.outcomes[sensor]
    }

    /// Forgets all outcomes: the filter starts anew.
    pub(super) fn forget(&mut self) {
        self.outcomes.fill(None);
    }

    /// Sets a sensor by a row of its switch. Returns why the row, or a part of it, is not used.
    pub(super) fn set(&mut self, sensor: usize, row: &[f64]) -> Option<Discard> {
        let (switch, setting) = (self.units[sensor].switch.as_ref()?, &mut self.settings[sensor]);
        let columns = &switch.port.columns;
        let read = |is_there: bool, column: Option<&usize>| {
            let number = row[*column.filter(|_| is_there)?];
            number.is_finite().then_some(number)
        };
        if let Some(used) = read(switch.has_use, columns.first()) {
            setting.is_used = used != 0.0;
        }
        let noise = read(switch.has_noise, columns.last())?;
        if noise <= 0.0 {
            let column = columns.len() - 1;
            return Some(Discard::OutOfRange { column });
        }
        setting.noise = noise;
        None
    }

    /// The factor on the 1σ of a sensor's noise now; `None` while it is switched off.
    pub(super) fn factor(&self, sensor: usize) -> Option<f64> {
        let Setting { is_used, noise } = self.settings[sensor];
        is_used.then_some(noise)
    }

    /// Adds the delays that followers need.
    pub(super) fn follow(&self, delays: &mut Delays) {
        for (s, sensor) in self.units.iter().enumerate() {
            delays.are_estimated |= sensor.offset.is_some();
            let Some(leader) = self.leader(s).map(|leader| &self.units[leader]) else {
                continue;
            };
            if leader.port.stream == sensor.port.stream {
                delays.lead = delays.lead.max(sensor.port.delay - leader.least_delay());
            } else {
                delays.are_apart = true;
            }
        }
    }

    /// Puts the value and R of a measurement into their buffers. Returns the row's identity, and the reason why a
    /// filter at the time `now` cannot use it.
    pub(super) fn gather(&mut self, measurement: &Waiting, row: &Stored, now: Time) -> (RowId, Option<Discard>) {
        let s = &self.units[measurement.sensor];
        if s.port.columns.is_empty() {
            self.value.clone_from(&s.constant);
        } else {
            s.port.gather(row.values(), &mut self.value);
        }
        let m = s.model.size().residual;
        let noise = &mut self.noise[..m * m];
        s.noise.fill(row.values(), noise);
        if s.switch.is_some() {
            let factor = measurement.noise * measurement.noise;
            noise.iter_mut().for_each(|covariance| *covariance *= factor);
        }
        let why = if measurement.time < now {
            Some(Discard::Late { now })
        } else {
            let is_finite = self.value.iter().chain(&*noise).all(|v| v.is_finite());
            (!is_finite).then_some(Discard::NotFinite)
        };
        (row.id(&s.port.columns), why)
    }

    /// Offers the measurement that was gathered last to the estimator, whose belief has the same time.
    pub(super) fn offer(
        &mut self,
        estimator: &mut dyn Estimator,
        measurement: &Waiting,
        (row, id): (&Stored, RowId),
        circumstances: &Circumstances<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), Halt> {
        let &Waiting { time, sensor, .. } = measurement;
        let s = &mut self.units[sensor];
        let m = s.model.size().residual;
        let told = s.gate.leader().zip(circumstances.foreseen);
        let latest = told.and_then(|(leader, foreseen)| self.outcomes[leader].replace(foreseen));
        let observed = Observed {
            sensor,
            model: s.model.as_ref(),
            value: &self.value,
            noise: &self.noise[..m * m],
            quality: s.quality.map(|column| row.values()[column]),
            derivative_input: circumstances.expected,
            lateness: s
                .offset
                .as_ref()
                .zip(circumstances.shift)
                .map(|(offset, (assumed, input))| Lateness {
                    offset: &offset.value,
                    assumed,
                    input,
                }),
        };
        let update = estimator.update(&observed, s.gate.as_mut(), &self.outcomes, s.loss.as_ref());
        if let Some((leader, _)) = told {
            self.outcomes[leader] = latest;
        }
        self.outcomes[sensor] = Some(Outcome {
            time,
            is_used: matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired),
            mode: update.mode,
        });
        observer.on(&Event::Updated {
            sensor,
            update,
            time,
            row: id,
        })
    }
}
