//! The evidence of one sensor for or against the belief.

use super::aid::{Aid, Axes};
use super::means::Means;
use super::pulse::{Held, Pulse};
use super::{Limits, Reason, Watched};
use crate::consistency::chi_square_quantile;
use crate::filter::{Update, Verdict};
use crate::math;
use crate::time::Time;
use alloc::vec::Vec;

/// The least number of measurements that innovations are averaged over.
const WINDOW: f64 = 10.0;
/// One measurement alone counts for at most this fraction of the limit, so that three are needed.
const SHARE: f64 = 1.0 / 2.5;
/// The mean grows to at most this multiple of the limit. Good measurements then bring it back within half of the
/// averaging window.
const MOST: f64 = 1.5;
/// Rejections in a row that count.
const STREAK: u32 = 3;
/// Rejections in a row of each of two sensors that count. A single rejection of each occurs by chance at high rates.
const PAIR: u32 = 2;
/// Measurements used after a re-acquisition before the sensor is trusted as before.
const PROVEN: u32 = 5;
/// A pause of this number of periods ends a streak of rejections and makes innovations old.
const PAUSE: f64 = 10.0;
/// The measured axes of a sensor are renewed no more often than this \[s\].
const LOOK: f64 = 1.0;
/// The probability of residuals that a consistent filter sees. A rejected residual beyond it contradicts the
/// estimate's σ.
const EXPECTED: f64 = 0.999;
/// How false measurements occur, by the defaults of the gate `hypotheses`: the probability that a measurement is false
/// after a good one, and that it is good after a false one.
const BEGINS: f64 = 0.01;
const ENDS: f64 = 0.2;

/// The mean NIS per residual row, forgetting exponentially. No single NIS has too large a share.
#[derive(Clone, Copy, Debug)]
struct Mean {
    value: f64,
    limit: f64,
}
crate::memory!(Mean { value; limit });

impl Mean {
    /// With the limit as a root mean square.
    const fn new(limit: f64) -> Self {
        Self {
            value: 1.0,
            limit: limit * limit,
        }
    }

    fn add(&mut self, nis_per_row: f64, window: f64) {
        let most = self.limit * window * SHARE;
        // `min` replaces NaN by the largest value.
        self.value += (nis_per_row.min(most) - self.value) / window;
        self.value = self.value.min(MOST * self.limit);
    }

    fn is_beyond(&self) -> bool {
        self.value > self.limit
    }
}

/// Rejections in a row whose residuals the covariance does not explain.
#[derive(Clone, Copy, Debug, Default)]
struct Streak {
    first: Time,
    latest: Time,
    count: u32,
    /// How many of them, without a break until the latest, all hypotheses of a bank rejected.
    by_all: u32,
}
crate::memory!(Streak {
    first,
    latest,
    count,
    by_all
});

/// The combined state of the sensors from outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Others<'a> {
    /// Which axes they have measured.
    pub(super) aid: &'a Aid,
    /// How many of them are being rejected,
    pub(super) rejected: usize,
    /// and how many have been rejected for so long that the filter may be lost.
    pub(super) rejected_long: usize,
    /// Whether the innovations of any sensor have a mean.
    pub(super) biased: bool,
}

impl Streak {
    /// Whether it is so long that the filter may be lost. All hypotheses of a bank reject a good filter's sensor only
    /// while its measurements are false.
    fn is_long(&self, period: f64, limits: &Limits) -> bool {
        self.lasts(limits.rejected_lost) || f64::from(self.by_all) >= longest_false(period, limits.false_alarm)
    }

    /// Whether it is long enough.
    fn lasts(&self, time: f64) -> bool {
        self.count >= STREAK && self.latest.seconds_since(self.first) >= time
    }
}

/// The number of false measurements in a row that occurs once in `between` \[s\], for a sensor with this period \[s\]:
/// a streak of n or more begins at each measurement with the probability b (1 − e)ⁿ⁻¹.
fn longest_false(period: f64, between: f64) -> f64 {
    if period > 0.0 {
        (1.0 - math::ln(BEGINS * between / period) / math::ln(1.0 - ENDS)).max(f64::from(STREAK))
    } else {
        f64::INFINITY
    }
}

/// Follows one sensor.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    /// Whether its rows come from outside. A stage may have reasons to be silent, and its rows are often no
    /// measurements.
    pub(super) is_outside: bool,
    rows: f64,
    expected: f64,
    pulse: Pulse,
    degraded: Mean,
    lost: Mean,
    means: Means,
    streak: Option<Streak>,
    /// When it was re-acquired, and how many measurements have been used since.
    reacquired: Option<(Time, u32)>,
    /// The axes that it measures (all of them until they are known), and when they were renewed.
    axes: Axes,
    looked: Option<Time>,
    /// Whether other sensors measured its axes when it was silent.
    replaced: bool,
    held: [Held; 7],
}
crate::memory!(Evidence { pulse, degraded, lost, means, streak, reacquired, axes, looked, replaced, held; is_outside, rows, expected });

impl Evidence {
    /// The evidence of one sensor; `rows` is the number of rows of all sensors together.
    pub(super) fn new(sensor: Watched, limits: &Limits, rows: usize) -> Self {
        Self {
            is_outside: sensor.is_outside,
            rows: sensor.rows.max(1) as f64,
            expected: chi_square_quantile(EXPECTED, sensor.rows as f64),
            pulse: Pulse::default(),
            degraded: Mean::new(limits.innovations),
            lost: Mean::new(limits.innovations_lost),
            // A sum for each sign of each row.
            means: Means::new(sensor.rows, limits.false_alarm * 2.0 * rows as f64),
            streak: None,
            reacquired: None,
            axes: Axes::ALL,
            looked: None,
            replaced: false,
            held: [Held::default(); 7],
        }
    }

    /// The filter starts anew.
    pub(super) fn restart(&mut self, time: Time) {
        self.pulse.restart(time);
        (self.degraded.value, self.lost.value) = (1.0, 1.0);
        self.means.restart();
        (self.streak, self.reacquired, self.looked) = (None, None, None);
        self.held = [Held::default(); 7];
    }

    /// Whether it is from outside and has been rejected twice in a row.
    pub(super) fn is_rejected(&self, now: Time) -> bool {
        let pause = PAUSE * self.pulse.period();
        let is_fresh = |s: &Streak| pause <= 0.0 || now.seconds_since(s.latest) <= pause;
        self.is_outside && self.streak.is_some_and(|s| is_fresh(&s) && s.count >= PAIR)
    }

    /// Whether it is from outside and has been rejected for so long that the filter may be lost.
    pub(super) fn is_rejected_long(&self, now: Time, limits: &Limits) -> bool {
        self.is_rejected(now) && self.streak.is_some_and(|s| s.is_long(self.pulse.period(), limits))
    }

    /// The axes that it measures.
    pub(super) const fn axes(&self) -> Axes {
        self.axes
    }

    /// Whether its innovations have a mean that chance does not explain.
    pub(super) fn is_biased(&self, now: Time, limits: &Limits) -> bool {
        self.means.is_beyond(1.0) && self.pulse.is_fresh(now, limits.window, PAUSE)
    }

    /// Its mean period \[s\]; 0 until two have come.
    pub(super) const fn period(&self) -> f64 {
        self.pulse.period()
    }

    /// Takes the outcome of a measurement.
    pub(super) fn hear(&mut self, time: Time, update: &Update<'_>, limits: &Limits, aid: &Aid) {
        self.pulse.beat(time);
        if let Some(h) = update.jacobian
            && self.looked.is_none_or(|looked| time.seconds_since(looked) >= LOOK)
        {
            (self.axes, self.looked) = (aid.axes(h, update.innovation_sigma), Some(time));
        } else if let Some(h) = update.jacobian
            && self.looked == Some(time)
        {
            // Several rows of one epoch, such as satellites, measure together.
            self.axes = self.axes.with(aid.axes(h, update.innovation_sigma));
        }
        match update.verdict {
            Verdict::Accepted => {
                self.streak = None;
                let period = self.pulse.period();
                // Until the period is known, the shortest window is used.
                let window = if period > 0.0 { WINDOW.max(limits.window / period) } else { WINDOW };
                self.degraded.add(update.nis / self.rows, window);
                self.lost.add(update.nis / self.rows, window);
                self.means.add(update, period, limits.window);
                if let Some((_, used)) = &mut self.reacquired {
                    *used = used.saturating_add(1);
                }
            }
            Verdict::Reacquired => {
                self.streak = None;
                self.means.forget();
                self.reacquired = Some((time, 0));
            }
            Verdict::Rejected if update.nis > self.expected => self.rejected(time, update.rivals.rejected),
            Verdict::Rejected | Verdict::Undefined(_) | Verdict::Unusable => {}
        }
    }

    fn rejected(&mut self, time: Time, by_all: bool) {
        let pause = PAUSE * self.pulse.period();
        let fresh = Streak {
            first: time,
            latest: time,
            count: 0,
            by_all: 0,
        };
        let streak = self.streak.get_or_insert(fresh);
        if pause > 0.0 && time.seconds_since(streak.latest) > pause {
            *streak = fresh;
        }
        streak.latest = time;
        streak.count = streak.count.saturating_add(1);
        streak.by_all = if by_all { streak.by_all.saturating_add(1) } else { 0 };
    }

    /// Puts the reasons that hold at `now` for this sensor, number `sensor`, into `reasons`.
    pub(super) fn judge(&mut self, sensor: usize, now: Time, others: Others<'_>, limits: &Limits, reasons: &mut Vec<Reason>) {
        let lasts = |time| self.streak.is_some_and(|s| s.lasts(time));
        let is_rejected = lasts(limits.rejected) || (others.rejected > 1 && self.is_rejected(now));
        let is_alone = self.streak.is_some_and(|s| !others.aid.holds(self.axes, s.first));
        let is_long = self.streak.is_some_and(|s| s.is_long(self.pulse.period(), limits));
        let is_lost = self.is_outside && is_long && (is_alone || others.rejected_long > 1);
        if let Some((time, used)) = self.reacquired
            && used >= PROVEN
            && now.seconds_since(time) > limits.reacquired
        {
            self.reacquired = None;
        }
        // When a stage is silent, its sensor's evidence is old. For a sensor from outside, evidence of a lost filter
        // stays valid during a silence, because nothing has corrected the filter meanwhile.
        let is_fresh = self.pulse.is_fresh(now, limits.window, PAUSE);
        let stands = is_fresh || self.is_outside;
        let is_silent = self.is_outside && self.pulse.is_silent(now, limits);
        // The value at the silence is kept while the reason is still reported: the sensor's own later measurements
        // are no replacement.
        if is_silent {
            self.replaced = others.aid.measures(self.axes, now, self.pulse.pause(limits));
        }
        let replaced = self.replaced;
        // If two sensors contradict each other, the filter follows each of them in part.
        let is_biased = is_fresh && self.means.is_beyond(if others.biased { 0.5 } else { 1.0 });
        let conditions = [
            (self.lost.is_beyond() && stands, Reason::Innovations { sensor, lost: true }),
            (is_lost, Reason::Rejected { sensor, lost: true }),
            (self.degraded.is_beyond() && is_fresh, Reason::Innovations { sensor, lost: false }),
            (is_rejected && is_fresh, Reason::Rejected { sensor, lost: false }),
            (self.reacquired.is_some(), Reason::Reacquired { sensor }),
            (is_silent, Reason::Silent { sensor, replaced }),
            (is_biased, Reason::Biased { sensor }),
        ];
        let mut told = [false; 7];
        for (k, (held, (holds, _))) in self.held.iter_mut().zip(conditions).enumerate() {
            held.hear(now, holds);
            // Of two reasons of the same kind, only the graver is reported.
            told[k] = held.is_told(now, limits) && !(matches!(k, 2 | 3) && told[k - 2]);
        }
        reasons.extend(
            conditions
                .iter()
                .zip(told)
                .filter(|(_, told)| *told)
                .map(|((_, reason), _)| *reason),
        );
    }
}
