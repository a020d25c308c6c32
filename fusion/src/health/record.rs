//! Keeps the health of every filter of a run over time.

use super::reason::{NamedReason, Names, word, words};
use crate::assembly::Assembly;
use crate::observe::{Entry, Filters, Heard, Listed, RunEnd, RunEvent, RunObserver, SectionObserver, Shared, Summary};
use crate::score::Outage;
use fusion_core::filter::Verdict;
use fusion_core::health::{Health, State};
use fusion_core::memory::Memory;
use fusion_core::runner::{Event, Halt};
use fusion_core::time::{Time, nanos};
use schemars::JsonSchema;
use serde::Serialize;

/// Changes that are kept of a filter; the others are counted.
const KEPT: usize = 1000;

/// A change of the health.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Transition {
    /// When \[s\].
    pub time: f64,
    /// The state from then on.
    #[serde(serialize_with = "word")]
    #[schemars(schema_with = "words")]
    pub state: State,
    /// All reasons that hold from then on; the state may be the same as before.
    pub reasons: Vec<NamedReason>,
    /// Time of it that fell within declared outages or just after them \[s\].
    #[serde(skip)]
    pub in_outages: f64,
}

/// Time spent in each state \[s\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Spent {
    /// Good.
    pub good: f64,
    /// Aligning.
    pub aligning: f64,
    /// Coasting.
    pub coasting: f64,
    /// Degraded.
    pub degraded: f64,
    /// Lost.
    pub lost: f64,
}

impl Spent {
    /// In `state`.
    #[must_use]
    pub const fn of(&self, state: State) -> f64 {
        match state {
            State::Good => self.good,
            State::Aligning => self.aligning,
            State::Coasting => self.coasting,
            State::Degraded => self.degraded,
            State::Lost => self.lost,
        }
    }

    fn add(&mut self, state: State, seconds: f64) {
        let spent = match state {
            State::Good => &mut self.good,
            State::Aligning => &mut self.aligning,
            State::Coasting => &mut self.coasting,
            State::Degraded => &mut self.degraded,
            State::Lost => &mut self.lost,
        };
        *spent += seconds;
    }

    /// In all of them.
    #[must_use]
    pub fn total(&self) -> f64 {
        State::ALL.iter().map(|s| self.of(*s)).sum()
    }
}

/// The health of a filter over a run.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub struct FilterHealth {
    /// The stage that it is inside of, after those around it, with dots; empty of the design's own.
    pub filter: String,
    /// The state at the end.
    #[serde(serialize_with = "word")]
    #[schemars(schema_with = "words")]
    pub state: State,
    /// When it was good for the first time \[s\].
    pub aligned: Option<f64>,
    /// The worst state from then on. If the filter was never good, the worst state of all.
    #[serde(serialize_with = "word")]
    #[schemars(schema_with = "words")]
    pub worst: State,
    /// Time spent in each state \[s\], from the first row to the last estimate.
    pub spent: Spent,
    /// The degraded and lost time that fell within declared outages \[s\]. An outage counts from its start to the first
    /// measurement after it, used or rejected, and for the time that a reason is still reported after it has ceased.
    pub in_outages: f64,
    /// The time of the last estimate \[s\].
    pub until: f64,
    /// The changes in order of time, the first thousand.
    pub transitions: Vec<Transition>,
    /// How many more there were.
    pub further_transitions: u64,
}

impl FilterHealth {
    /// Whether it has been good ever since it had aligned.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.aligned.is_some() && self.worst == State::Good
    }

    /// Returns true if it was in ill health only within declared outages.
    #[must_use]
    pub fn is_ill_as_declared(&self) -> bool {
        let ill = self.spent.degraded + self.spent.lost;
        // 1e-6: rounding of sums of times.
        self.in_outages > 0.0 && ill - self.in_outages < 1e-6
    }
}

/// A stretch of time in one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Spell {
    /// When it began \[s\].
    pub from: f64,
    /// When it ended \[s\].
    pub to: f64,
    /// The state.
    pub state: State,
    /// When the first reason came \[s\]: a state that is not ill health may begin without a reason.
    pub told: f64,
    /// When the last reason ceased \[s\]; `to` if a reason still held.
    pub told_until: f64,
    /// Why, each once, in the order in which they came.
    pub reasons: Vec<NamedReason>,
    /// Time of it that fell within declared outages or just after them \[s\].
    pub in_outages: f64,
}

impl Spell {
    /// How long it lasted \[s\].
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.to - self.from
    }

    /// Returns true if it is a period of ill health that declared outages do not fully explain.
    #[must_use]
    pub fn is_ill_undeclared(&self) -> bool {
        // 1e-6: rounding of sums of times.
        self.state >= State::Degraded && self.seconds() - self.in_outages > 1e-6
    }
}

impl FilterHealth {
    /// The stretches of one state each, as far as the changes are kept.
    #[must_use]
    pub fn spells(&self) -> Vec<Spell> {
        let mut all: Vec<Spell> = Vec::new();
        let ends = self.transitions.iter().skip(1).map(|t| t.time).chain([self.until]);
        for (change, end) in self.transitions.iter().zip(ends) {
            match all.last_mut().filter(|last| last.state == change.state) {
                Some(last) => {
                    last.to = end;
                    last.in_outages += change.in_outages;
                    if last.reasons.is_empty() {
                        last.told = change.time;
                    }
                    last.told_until = if change.reasons.is_empty() {
                        last.told_until.min(change.time)
                    } else {
                        end
                    };
                    let new = change.reasons.iter().filter(|r| !last.reasons.contains(r));
                    let new: Vec<NamedReason> = new.cloned().collect();
                    last.reasons.extend(new);
                }
                None => all.push(Spell {
                    from: change.time,
                    to: end,
                    told: change.time,
                    told_until: end,
                    state: change.state,
                    reasons: change.reasons.clone(),
                    in_outages: change.in_outages,
                }),
            }
        }
        all
    }
}

/// Observes the health of all filters.
#[derive(Debug)]
pub(crate) struct HealthRecord {
    /// By filter.
    followed: Box<[Followed]>,
}

#[derive(Debug)]
struct Followed {
    names: Names,
    health: FilterHealth,
    silences: Box<[Silence]>,
    /// Up to when the time spent is counted.
    counted: Option<Time>,
}

impl HealthRecord {
    /// For the filters of an assembly; `outages` are declared for the sources of the outermost filter.
    #[must_use]
    pub fn new(filters: &Filters, assembly: &Assembly, outages: &[Outage]) -> Self {
        let declared = |filter: &Heard| if filter.is_outermost() { outages } else { &[] };
        let silence = |outage: &Outage| Silence {
            outage: outage.clone(),
            running: None,
            told: None,
            hold: assembly.runner.limits().hold,
        };
        let followed = filters.iter().map(|filter| Followed {
            silences: declared(filter).iter().map(silence).collect(),
            names: Names::new(filter, assembly),
            health: FilterHealth {
                filter: filter.stages.join("."),
                ..FilterHealth::default()
            },
            counted: None,
        });
        Self {
            followed: followed.collect(),
        }
    }
}

impl Listed for FilterHealth {
    const NAME: &'static str = "health";
}

impl SectionObserver for HealthRecord {
    fn share(&self, shared: &mut Shared) {
        shared.aligned = self.followed.iter().map(|f| f.health.aligned).collect();
    }

    fn finish(self: Box<Self>, _: &RunEnd<'_>) -> Result<Entry, Halt> {
        let filters: Vec<FilterHealth> = self.followed.into_iter().map(|f| f.health).collect();
        Ok(filters.into())
    }
}

impl Summary {
    /// The self-reported health of the filters: first the outermost filter, then the filters inside stages.
    #[must_use]
    pub fn health(&self) -> &[FilterHealth] {
        self.list()
    }
}

/// Health is judged ten times a second. A reason disappears at most this long after it ceases \[s\].
const LATE: f64 = 0.2;

/// A declared outage. `running` is the end of the outage until a measurement after that end is judged.
#[derive(Debug)]
struct Silence {
    outage: Outage,
    running: Option<Time>,
    /// The outage still counts until `told`: health reports a reason for the time `hold` \[s\] after it has ceased.
    told: Option<Time>,
    hold: f64,
}

impl Silence {
    /// Returns true if the outage, or its effect on the health, lasts at `time`.
    fn holds(&mut self, time: Time) -> bool {
        let begun = self.outage.windows.containing(time).map(|window| window.to);
        self.running = begun.or(self.running);
        self.running.is_some() || self.told.is_some_and(|until| time <= until)
    }

    /// A measurement of `sensor`, stamped `stamp`, was judged at `time`.
    fn judged(&mut self, sensor: usize, stamp: Time, time: Time) {
        let is_over = self.running.is_some_and(|to| stamp >= to);
        if is_over && (self.outage.sensors.is_empty() || self.outage.sensors.contains(&sensor)) {
            (self.running, self.told) = (None, Some(time.shifted(nanos(self.hold + LATE))));
        }
    }
}

impl Followed {
    fn reach(&mut self, time: Time) {
        let since = *self.counted.get_or_insert(time);
        // Each has to see the time.
        let holding: u32 = self.silences.iter_mut().map(|silence| u32::from(silence.holds(since))).sum();
        let is_declared = holding > 0;
        if time > since {
            let seconds = time.seconds_since(since);
            self.health.spent.add(self.health.state, seconds);
            if is_declared && self.health.state >= State::Degraded {
                self.health.in_outages += seconds;
                let kept = self.health.transitions.last_mut().filter(|_| self.health.further_transitions == 0);
                kept.into_iter().for_each(|t| t.in_outages += seconds);
            }
            self.counted = Some(time);
            self.health.until = time.seconds();
        }
    }

    fn change(&mut self, health: &Health) {
        self.reach(health.since);
        let own = &mut self.health;
        own.state = health.state;
        own.worst = own.worst.max(health.state);
        if own.aligned.is_none() && health.state == State::Good {
            (own.aligned, own.worst) = (Some(health.since.seconds()), State::Good);
        }
        if own.transitions.len() == KEPT {
            own.further_transitions += 1;
            return;
        }
        own.transitions.push(Transition {
            time: health.since.seconds(),
            state: health.state,
            reasons: health.reasons.iter().map(|r| self.names.of(*r)).collect(),
            in_outages: 0.0,
        });
    }
}

fusion_core::memory!(HealthRecord { followed });
fusion_core::memory!(Followed { health, counted, silences; names });
fusion_core::memory!(Silence { running, told; outage, hold });
fusion_core::memory!(FilterHealth {
    state,
    aligned,
    worst,
    spent,
    in_outages,
    until,
    transitions,
    further_transitions;
    filter
});
fusion_core::memory!(Transition {
    time,
    state,
    reasons,
    in_outages
});
fusion_core::memory!(Spent {
    good,
    aligning,
    coasting,
    degraded,
    lost
});

impl RunObserver for HealthRecord {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        match event {
            RunEvent::Row(row) => {
                let waiting = self.followed.iter_mut().filter(|f| f.counted.is_none());
                waiting.for_each(|f| f.reach(row.time));
            }
            RunEvent::Estimate { filter, belief, .. } => self.followed[filter.number].reach(belief.time),
            RunEvent::Filter {
                filter,
                event: Event::Health { health },
            } => self.followed[filter.number].change(health),
            RunEvent::Filter {
                filter,
                event: Event::Updated { sensor, update, time, row },
            } if matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired | Verdict::Rejected) => {
                let followed = &mut self.followed[filter.number];
                followed.reach(*time);
                followed
                    .silences
                    .iter_mut()
                    .for_each(|silence| silence.judged(*sensor, row.stamp, *time));
            }
            _ => {}
        }
        Ok(())
    }
}
