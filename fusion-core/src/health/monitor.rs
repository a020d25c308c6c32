//! The monitor that judges a filter's health by the signs of its life.

use super::aid::Aid;
use super::blocks::Blocks;
use super::evidence::{Evidence, Others};
use super::pulse::{Held, Pulse};
use super::{Health, Limits, Reason, State};
use crate::belief::Belief;
use crate::filter::{Rivals, Update, Verdict};
use crate::memory::{Memory, Tape};
use crate::state::Layout;
use crate::stream::StreamId;
use crate::time::Time;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Beliefs are looked at no more often than this \[s\].
const PERIOD: f64 = 0.1;

/// A stamp ahead of the input is reported for this time \[s\]: slow sensors send a stamp every second or less.
const AHEAD: f64 = 10.0;

/// The properties of a sensor that a monitor needs.
#[derive(Clone, Copy, Debug)]
pub struct Watched {
    /// Numbers in its residual.
    pub rows: usize,
    /// Whether its rows come from outside, not from a stage.
    pub is_outside: bool,
}

/// Something that a monitor hears of its filter.
#[derive(Clone, Copy, Debug)]
pub enum Sign<'a> {
    /// The filter starts from this belief.
    Started {
        /// The initial belief.
        belief: &'a Belief,
        /// Other beliefs that may be true.
        rivals: Rivals,
    },
    /// The estimate of an epoch.
    Estimate(&'a Belief),
    /// A measurement has been offered.
    Updated {
        /// The number of the sensor.
        sensor: usize,
        /// The measurement, and its outcome.
        update: &'a Update<'a>,
        /// Time of validity.
        time: Time,
    },
    /// The input is missing.
    Coasting {
        /// Since then.
        since: Time,
        /// Now.
        time: Time,
    },
    /// The input is back.
    Resumed(Time),
    /// The filter has stopped, and waits for a new start.
    Stopped(Time),
    /// The filter has given up.
    GaveUp(Time),
    /// A stamp of this stream is ahead of the input.
    Ahead(StreamId),
    /// The filter has refused a step.
    Failed,
}

/// Judges the health of one filter.
#[derive(Clone, Debug)]
pub struct Monitor {
    limits: Limits,
    sensors: Vec<Evidence>,
    aid: Aid,
    /// Streams that only stages read.
    streams: Vec<(StreamId, Pulse, Held)>,
    blocks: Blocks,
    phase: Phase,
    /// The distance between the attitudes that may be true \[rad\].
    rivals: f64,
    /// Whether they were too far apart at the latest belief that was judged.
    was_undecided: bool,
    /// The time of the latest judgement, and of the latest belief that was judged.
    now: Time,
    scrutinised: Time,
    /// The end of the input during a gap.
    gap: Option<Time>,
    /// The stream that was ahead of the input last, and when.
    ahead: Option<(StreamId, Time)>,
    /// Whether a sensor contradicted the belief at the latest judgement.
    contradicted: bool,
    refused: Held,
    unsound: Held,
    unaided: Held,
    health: Health,
    /// Lent to the next judgement.
    reasons: Vec<Reason>,
}

impl Memory for Monitor {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.sensors.as_mut_slice().remember(tape);
        self.aid.remember(tape);
        for (_, pulse, held) in &mut self.streams {
            pulse.remember(tape);
            held.remember(tape);
        }
        self.blocks.remember(tape);
        tape.choice(
            &mut self.phase,
            &[Phase::Waiting, Phase::Stopped, Phase::GaveUp, Phase::Aligning, Phase::Aligned],
        );
        self.rivals.remember(tape);
        self.was_undecided.remember(tape);
        self.now.remember(tape);
        self.scrutinised.remember(tape);
        self.gap.remember(tape);
        self.ahead.remember(tape);
        self.contradicted.remember(tape);
        self.refused.remember(tape);
        self.unsound.remember(tape);
        self.unaided.remember(tape);
        self.health.remember(tape);
    }
}

/// How far a filter has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Waiting,
    Stopped,
    GaveUp,
    Aligning,
    Aligned,
}

impl Monitor {
    /// A monitor for a filter with these states and sensors; `streams` are the streams that only stages read.
    #[must_use]
    pub fn new(
        limits: Limits,
        layout: &Arc<Layout>,
        sensors: impl IntoIterator<Item = Watched>,
        streams: impl IntoIterator<Item = StreamId>,
    ) -> Self {
        let sensors: Vec<Watched> = sensors.into_iter().collect();
        let rows = sensors.iter().map(|s| s.rows).sum();
        let sensors: Vec<_> = sensors.into_iter().map(|s| Evidence::new(s, &limits, rows)).collect();
        let streams: Vec<_> = streams.into_iter().map(|s| (s, Pulse::default(), Held::default())).collect();
        // Each reason once at most: seven for a sensor, three for a block, seven for the filter.
        let most = 7 * sensors.len() + streams.len() + 3 * layout.blocks().len() + 7;
        Self {
            limits,
            sensors,
            aid: Aid::new(layout),
            streams,
            blocks: Blocks::new(Arc::clone(layout)),
            phase: Phase::Waiting,
            rivals: 0.0,
            was_undecided: false,
            now: Time::MIN,
            scrutinised: Time::MIN,
            gap: None,
            ahead: None,
            contradicted: false,
            refused: Held::default(),
            unsound: Held::default(),
            unaided: Held::default(),
            health: Health {
                reasons: Vec::with_capacity(most),
                ..Health::UNKNOWN
            },
            reasons: Vec::with_capacity(most),
        }
    }

    /// The health now.
    #[must_use]
    pub const fn health(&self) -> &Health {
        &self.health
    }

    /// Hears of a row of any stream.
    pub fn row(&mut self, stream: StreamId, stamp: Time) {
        if let Some((_, pulse, _)) = self.streams.iter_mut().find(|(s, ..)| *s == stream) {
            pulse.beat(stamp);
        }
    }

    /// Hears a sign. Returns true if the health has changed.
    pub fn hear(&mut self, sign: Sign<'_>) -> bool {
        let now = match sign {
            Sign::Started { belief, rivals } => {
                self.rivals = rivals.apart;
                self.start(belief)
            }
            // Estimates may be frequent: the others change nothing important within this time.
            Sign::Estimate(belief) if belief.time.seconds_since(self.scrutinised) < PERIOD => return false,
            Sign::Estimate(belief) => self.estimate(belief),
            Sign::Updated { sensor, update, time } => {
                self.updated(sensor, time, update);
                time
            }
            Sign::Coasting { since, time } => {
                self.gap.get_or_insert(since);
                time
            }
            Sign::Resumed(time) => {
                self.gap = None;
                time
            }
            Sign::Stopped(time) => {
                (self.phase, self.gap) = (Phase::Stopped, None);
                time
            }
            Sign::GaveUp(time) => {
                (self.phase, self.gap) = (Phase::GaveUp, None);
                time
            }
            Sign::Ahead(stream) => {
                // Rows may be held back: the judgement has the time of the rows in use.
                self.ahead = Some((stream, self.now));
                return false;
            }
            Sign::Failed => {
                self.refused.hear(self.now, true);
                self.now
            }
        };
        self.judge(now)
    }

    fn start(&mut self, belief: &Belief) -> Time {
        self.phase = Phase::Aligning;
        self.gap = None;
        (self.refused, self.unsound, self.unaided) = Default::default();
        self.contradicted = false;
        self.aid.start(belief);
        self.blocks.start(belief);
        self.sensors.iter_mut().for_each(|s| s.restart(belief.time));
        for (_, pulse, held) in &mut self.streams {
            pulse.restart(belief.time);
            *held = Held::default();
        }
        self.estimate(belief)
    }

    fn estimate(&mut self, belief: &Belief) -> Time {
        self.scrutinised = belief.time;
        // Once aligned, the filter may fall back by a factor of two, so that the state does not flicker.
        let allowed = self.limits.aligned * if self.phase == Phase::Aligned { 2.0 } else { 1.0 };
        let is_aligned = self.blocks.attitude_within(belief, allowed) && self.rivals <= allowed;
        self.phase = if is_aligned { Phase::Aligned } else { Phase::Aligning };
        self.unsound.hear(belief.time, !belief.is_sound());
        self.blocks.hear(belief, &self.limits);
        self.aid.hear(belief);
        let is_undecided = self.rivals > allowed;
        if is_undecided || self.was_undecided {
            self.blocks.forget(belief);
        } else {
            self.blocks.follow(belief, &self.limits, self.contradicted);
        }
        self.was_undecided = is_undecided;
        belief.time
    }

    fn updated(&mut self, sensor: usize, time: Time, update: &Update<'_>) {
        self.rivals = update.rivals.apart;
        let Some(evidence) = self.sensors.get_mut(sensor) else { return };
        evidence.hear(time, update, &self.limits, &self.aid);
        if matches!(update.verdict, Verdict::Accepted | Verdict::Reacquired) {
            self.aid.used(time, evidence.axes(), evidence.period(), evidence.is_outside);
        }
    }

    /// Collects the reasons. Returns whether they, or the state, have changed.
    fn judge(&mut self, now: Time) -> bool {
        self.now = now;
        let (limits, reasons) = (&self.limits, &mut self.reasons);
        reasons.clear();
        self.contradicted = false;
        if matches!(self.phase, Phase::Aligning | Phase::Aligned) {
            if self.gap.is_some_and(|since| now.seconds_since(since) > limits.coasting) {
                reasons.push(Reason::InputGap);
            }
            self.unaided.hear(now, self.aid.is_missing(now, limits.unaided));
            let own = [
                (&self.refused, Reason::Refused),
                (&self.unsound, Reason::Unsound),
                (&self.unaided, Reason::Unaided),
            ];
            for (held, reason) in own {
                if held.is_told(now, limits) {
                    reasons.push(reason);
                }
            }
            if let Some((stream, latest)) = self.ahead {
                if now.seconds_since(latest) <= AHEAD {
                    reasons.push(Reason::Ahead { stream });
                } else {
                    self.ahead = None;
                }
            }
            self.blocks.tell(now, limits, reasons);
            let others = Others {
                aid: &self.aid,
                rejected: self.sensors.iter().filter(|s| s.is_rejected(now)).count(),
                rejected_long: self.sensors.iter().filter(|s| s.is_rejected_long(now, limits)).count(),
                biased: self.sensors.iter().any(|s| s.is_biased(now, limits)),
            };
            for (number, sensor) in self.sensors.iter_mut().enumerate() {
                sensor.judge(number, now, others, limits, reasons);
            }
            self.contradicted = reasons.iter().any(Reason::is_contradiction);
            for (stream, pulse, held) in &mut self.streams {
                held.hear(now, pulse.is_silent(now, limits));
                if held.is_told(now, limits) {
                    reasons.push(Reason::StreamSilent { stream: *stream });
                }
            }
            if self.phase == Phase::Aligning && self.rivals > limits.aligned {
                reasons.push(Reason::Undecided);
            }
        } else if self.phase == Phase::Stopped {
            reasons.push(Reason::Stopped);
        } else if self.phase == Phase::GaveUp {
            reasons.push(Reason::GaveUp);
        }
        let least = if self.phase == Phase::Aligned {
            State::Good
        } else {
            State::Aligning
        };
        let state = reasons.iter().map(|r| r.state()).fold(least, State::max);
        let has_changed = state != self.health.state || *reasons != self.health.reasons;
        if has_changed {
            (self.health.state, self.health.since) = (state, now);
            core::mem::swap(reasons, &mut self.health.reasons);
        }
        has_changed
    }
}
