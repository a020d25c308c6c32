//! A bank of hypotheses, for measurements that may be good or false.
//!
//! A gate that must decide at once may be wrong, and an accepted measurement cannot be removed again. A bank
//! postpones the decision. If a gate gives [odds](Gate::odds), the bank continues each hypothesis in up to three
//! ways, each only if it is probable enough: the measurement is good, it is false, or it is good and the estimate is
//! lost. Each continuation is a whole estimator, with its own state of the gates. By Bayes' rule its weight is
//! multiplied by its probability density of every later measurement, from any sensor. The bank merges hypotheses that
//! become alike, and drops the least probable.
//!
//! A gate without odds decides by itself, and declares nothing about false measurements. The bank assumes that one in
//! a million is false. While several starts are possible, a measurement that such a gate rejects is also followed as
//! good. Otherwise all hypotheses could reject the same good measurement just outside their gates. Their estimates
//! would then run away, and reject all that follow.
//!
//! The bank *shows* the hypothesis that continues the one shown before, unless another is more probable by a declared
//! factor. Without doubt there is one hypothesis, and the bank is its estimator.
//!
//! After Reid, *An algorithm for tracking multiple targets*, IEEE TAC 24 (1979).

use super::estimator::{Estimator, FilterError, Observed, Rivals, Update, Verdict};
use super::starts::{headings, is_angle};
use super::step::Step;
use crate::belief::Belief;
use crate::chart::{Body, Chart};
use crate::gate::{Answer, Decision, Gate, GateInput, Mode, Odds, Outcome, log_normal, log_sum};
use crate::loss::Loss;
use crate::math;
use crate::memory::{self, Memory, Tape};
use crate::model::Input;
use crate::state::{Block, Layout, View};
use crate::time::Time;
use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::f64::consts::TAU;

/// How many hypotheses the bank keeps, and which.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BankLimits {
    /// The most hypotheses, at least 1.
    pub most: usize,
    /// The bank follows each continuation of a hypothesis after a measurement whose probability is at least this
    /// fraction of the most probable one, in (0, 1).
    pub doubt: f64,
    /// The bank drops a hypothesis whose probability is below this fraction of the most probable one, in (0, 1).
    pub least: f64,
    /// The bank shows another hypothesis if it is more probable by this factor, at least 1.
    pub switch: f64,
    /// How many headings a start is tried with, all round; 1 for the heading of the initialisers alone.
    pub starts: usize,
}

impl BankLimits {
    /// Twenty hypotheses, one start.
    pub const DEFAULT: Self = Self {
        most: 20,
        doubt: 1e-8,
        least: 1e-15,
        switch: 1e6,
        starts: 1,
    };
}

/// Two hypotheses are merged if no axis of the state differs by more than this number of σ.
const ALIKE: f64 = 0.1;

/// A measurement is shown as used if that is more probable than its rejection by this factor.
const SURE: f64 = 20.0;

/// How probable a false measurement is, for a sensor whose gate gives no odds: one in a million.
const FALSE: f64 = 1e-6;

/// A copy of an update: the buffers of its estimator may change before it is reported.
#[derive(Debug)]
struct Report {
    verdict: Verdict,
    predicted: Vec<f64>,
    residual: Vec<f64>,
    sigma: Vec<f64>,
    factor: Vec<f64>,
    power: Vec<f64>,
    answer: Answer,
    nis: f64,
    weight: f64,
    /// Whether the gate of the sensor leaves it open whether a measurement is false.
    may_be_false: bool,
    weighed: Weighed,
    /// Whether its gate rejected the measurement, and [`Bank::is_in_doubt`].
    is_in_doubt: bool,
}

impl Report {
    const fn empty() -> Self {
        Self {
            verdict: Verdict::Unusable,
            predicted: Vec::new(),
            residual: Vec::new(),
            sigma: Vec::new(),
            factor: Vec::new(),
            power: Vec::new(),
            answer: NOT_ASKED,
            nis: f64::NAN,
            weight: 0.0,
            may_be_false: false,
            weighed: Weighed::Nothing,
            is_in_doubt: false,
        }
    }

    fn keep(&mut self, update: &Update<'_>) {
        let copies = [
            (&mut self.predicted, update.predicted),
            (&mut self.residual, update.residual),
            (&mut self.sigma, update.innovation_sigma),
            (&mut self.factor, update.innovation_factor),
            (&mut self.power, update.power),
        ];
        for (copy, original) in copies {
            copy.clear();
            copy.extend_from_slice(original);
        }
        (self.verdict, self.nis, self.weight) = (update.verdict, update.nis, update.weight);
        self.answer = Answer {
            statistic: update.statistic,
            threshold: update.threshold,
            mode: update.mode,
            ..NOT_ASKED
        };
    }

    const fn is_used(&self) -> bool {
        matches!(self.verdict, Verdict::Accepted | Verdict::Reacquired)
    }
}

const NOT_ASKED: Answer = Answer {
    decision: Decision::Reject,
    statistic: f64::NAN,
    threshold: f64::NAN,
    mode: Mode::Track,
};

/// A hypothesis: an estimator, and the state of the gates under it.
#[derive(Debug)]
struct Hypothesis {
    estimator: Box<dyn Estimator>,
    /// By the number of the sensor.
    gates: Vec<Box<dyn Gate>>,
    outcomes: Vec<Option<Outcome>>,
    /// ln of the probability, up to a constant.
    weight: f64,
    /// Whether it continues the hypothesis that is shown.
    is_successor: bool,
    report: Report,
}

impl Memory for Hypothesis {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let Self {
            estimator,
            gates,
            outcomes,
            weight,
            is_successor,
            // It belongs to the current update only.
            report: _,
        } = self;
        estimator.remember(tape);
        gates[..].remember(tape);
        outcomes.remember(tape);
        weight.remember(tape);
        is_successor.remember(tape);
    }
}

impl Hypothesis {
    fn new(estimator: Box<dyn Estimator>, gates: Vec<Box<dyn Gate>>) -> Self {
        Self {
            outcomes: vec![None; gates.len()],
            estimator,
            gates,
            weight: 0.0,
            is_successor: true,
            report: Report::empty(),
        }
    }

    /// Takes over what the runner expects of a sensor's next measurement. The past outcomes are the hypothesis's own.
    fn foresee(&mut self, others: &[Option<Outcome>]) {
        for (own, other) in self.outcomes.iter_mut().zip(others) {
            if own.is_none_or(|own| other.is_some_and(|other| other.time > own.time)) {
                *own = *other;
            }
        }
    }

    /// Offers the measurement to its estimator; `intent` decides its use.
    fn update(&mut self, intent: Intent, offer: &Offer<'_, '_>) -> Weighed {
        let sensor = offer.observed.sensor;
        self.report.weighed = Weighed::Nothing;
        let Some(gate) = self.gates.get_mut(sensor) else {
            return Weighed::Nothing;
        };
        let mut broker = Broker {
            gate: gate.as_mut(),
            intent,
            depth: offer.depth,
            weighed: Weighed::Nothing,
            gives_odds: false,
        };
        let update = self.estimator.update(offer.observed, &mut broker, &self.outcomes, offer.loss);
        let (weighed, gives_odds) = (broker.weighed, broker.gives_odds);
        if let Weighed::Doubt(_) = weighed {
            return weighed;
        }
        self.report.keep(&update);
        (self.report.may_be_false, self.report.weighed) = (gives_odds, weighed);
        let outcome = Outcome {
            time: self.estimator.belief().time,
            is_used: self.report.is_used(),
            mode: self.report.answer.mode,
        };
        self.outcomes[sensor] = Some(outcome);
        weighed
    }
}

/// A measurement as it is offered to every hypothesis.
#[derive(Debug)]
struct Offer<'a, 'b> {
    observed: &'a Observed<'b>,
    loss: &'a dyn Loss,
    /// ln of the least fraction of the best probability that a continuation needs to be followed.
    depth: f64,
}

/// The instruction to a hypothesis for a measurement.
#[derive(Clone, Copy, Debug)]
enum Intent {
    /// Decides if the case is clear, and does nothing if there is doubt.
    Weigh,
    /// Does this, without regard to the gate.
    Do(Decision),
    /// Uses the measurement, although its gate, which gives no odds, has just rejected it with this answer.
    Overrule(Answer),
}

/// How a measurement was weighed.
#[derive(Clone, Copy, Debug)]
enum Weighed {
    /// The hypothesis says nothing about the measurement. It was not judged, or it was rejected together with the
    /// measurement of the sensor that it follows.
    Nothing,
    /// ln of the density of the measurement under the decision.
    Done(f64),
    /// The gate gives no odds: ln of the density of a good measurement.
    Good {
        /// Of this measurement.
        density: f64,
        /// Of one whose NIS is the expected one, m.
        usual: f64,
    },
    /// More than one decision is possible, and nothing was done.
    Doubt(Odds),
}

/// The link between estimator and gate: it decides if the gate gives odds, and weighs the other measurements.
struct Broker<'a> {
    gate: &'a mut dyn Gate,
    intent: Intent,
    depth: f64,
    weighed: Weighed,
    gives_odds: bool,
}

impl core::fmt::Debug for Broker<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Broker").field("intent", &self.intent).finish_non_exhaustive()
    }
}

/// The most probable decision, its log density, and whether no other decision is within `depth`.
fn clearest(odds: &Odds, depth: f64) -> (Decision, f64, bool) {
    let ways = [
        (Decision::Accept, odds.good),
        (Decision::Reject, odds.bad),
        (Decision::Reacquire, odds.lost),
    ];
    let best = ways.iter().fold(ways[1], |best, way| if way.1 > best.1 { *way } else { best });
    let rivals = ways.iter().filter(|way| way.1 > best.1 - depth).count();
    (best.0, best.1, rivals <= 1)
}

impl Gate for Broker<'_> {
    fn judge(&mut self, input: &GateInput<'_>) -> Answer {
        if let Intent::Overrule(answer) = self.intent {
            return Answer {
                decision: Decision::Accept,
                ..answer
            };
        }
        let Some(odds) = self.gate.odds(input) else {
            let answer = self.gate.judge(input);
            let Some(density) = log_normal(input.residual, input.innovation) else {
                return answer;
            };
            // A gate that rejects without a threshold has made no test.
            let is_tested = answer.decision != Decision::Reject || answer.threshold.is_finite();
            if is_tested {
                let usual = density + 0.5 * (input.nis - input.residual.len() as f64);
                self.weighed = Weighed::Good { density, usual };
            }
            return answer;
        };
        self.gives_odds = true;
        let (decision, density, is_clear) = match self.intent {
            Intent::Weigh | Intent::Overrule(_) => clearest(&odds, self.depth),
            Intent::Do(Decision::Accept) => (Decision::Accept, odds.good, true),
            Intent::Do(Decision::Reject) => (Decision::Reject, odds.bad, true),
            Intent::Do(Decision::Reacquire) => (Decision::Reacquire, odds.lost, true),
        };
        if !is_clear {
            self.weighed = Weighed::Doubt(odds);
            return NOT_ASKED;
        }
        self.gate.judge(input);
        self.weighed = Weighed::Done(density);
        Answer {
            decision,
            // The probability that the measurement is false. Above one half, the measurement is rejected.
            statistic: math::exp(odds.bad - log_sum(odds.bad, log_sum(odds.good, odds.lost))),
            threshold: 0.5,
            mode: if decision == Decision::Reject { Mode::Denied } else { Mode::Track },
        }
    }

    fn settle(&mut self, is_used: bool) {
        if !matches!(self.weighed, Weighed::Doubt(_)) {
            self.gate.settle(is_used);
        }
    }

    fn power(&self, input: &GateInput<'_>, smallest: &mut [f64]) {
        self.gate.power(input, smallest);
    }
}

impl Memory for Broker<'_> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.gate.remember(tape);
    }
}

/// A bank of hypotheses of one estimator.
#[derive(Debug)]
pub struct Bank {
    limits: BankLimits,
    /// Never empty; the most probable first after an update.
    hypotheses: Vec<Hypothesis>,
    /// Members that no hypothesis needs now.
    spare: Vec<Hypothesis>,
    shown: usize,
    /// The difference of two states.
    delta: Vec<f64>,
    /// Axes of attitudes and angles, and the differences of the hypotheses along them.
    angles: Vec<usize>,
    rivals: Rivals,
    /// The memory through which one hypothesis is copied to another.
    tape: Vec<u8>,
}

/// Members per hypothesis: each continues in up to three ways before some are dropped.
const WAYS: usize = 3;

impl Bank {
    /// A bank whose members `make` makes, all alike. A member is an estimator, and the gates of all sensors by their
    /// number.
    #[must_use]
    pub fn new(limits: BankLimits, mut make: impl FnMut() -> (Box<dyn Estimator>, Vec<Box<dyn Gate>>)) -> Self {
        let mut member = || {
            let (estimator, gates) = make();
            Hypothesis::new(estimator, gates)
        };
        let first = member();
        let most = limits.most.max(1);
        let mut hypotheses = Vec::with_capacity(WAYS * most);
        let delta = vec![0.0; first.estimator.layout().dim()];
        let blocks = first.estimator.layout().blocks().iter();
        let angles = blocks.filter(|b| is_angle(b)).flat_map(Block::tangent_range).collect();
        hypotheses.push(first);
        Self {
            limits,
            hypotheses,
            spare: (1..WAYS * most).map(|_| member()).collect(),
            shown: 0,
            delta,
            angles,
            rivals: Rivals::NONE,
            tape: Vec::new(),
        }
    }

    /// A copy of hypothesis number `k`; `None` if there is no spare member.
    fn fork(&mut self, k: usize) -> Option<Hypothesis> {
        let mut fork = self.spare.pop()?;
        self.tape.clear();
        memory::save(&mut self.hypotheses[k], &mut self.tape);
        // A twin has just written these bytes.
        let is_copied = memory::recall(&mut fork, &self.tape).is_ok();
        debug_assert!(is_copied, "members of a bank are alike");
        Some(fork)
    }

    /// Returns hypothesis number `k` to the spare members.
    fn drop(&mut self, k: usize) {
        let dropped = self.hypotheses.remove(k);
        self.spare.push(dropped);
    }

    /// How many hypotheses there are.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.hypotheses.len()
    }

    /// Continues hypothesis number `k` in every probable way. The additional hypotheses are put at the end.
    fn branch(&mut self, k: usize, offer: &Offer<'_, '_>) {
        let hypothesis = &mut self.hypotheses[k];
        let odds = match hypothesis.update(Intent::Weigh, offer) {
            Weighed::Nothing | Weighed::Good { .. } => return,
            Weighed::Done(density) => {
                hypothesis.weight += density;
                return;
            }
            Weighed::Doubt(odds) => odds,
        };
        let (_, best, _) = clearest(&odds, offer.depth);
        for (decision, density) in [(Decision::Accept, odds.good), (Decision::Reacquire, odds.lost)] {
            if density > best - offer.depth {
                let Some(mut child) = self.fork(k) else { break };
                child.update(Intent::Do(decision), offer);
                child.weight += density;
                let list = if child.report.is_used() {
                    &mut self.hypotheses
                } else {
                    &mut self.spare
                };
                list.push(child);
            }
        }
        let hypothesis = &mut self.hypotheses[k];
        hypothesis.update(Intent::Do(Decision::Reject), offer);
        hypothesis.weight += odds.bad;
    }

    /// Weighs a measurement whose gate gives no odds, and shares it out to the hypotheses that say nothing about it.
    /// `before` is ln of the sum of the weights that the other hypotheses had.
    ///
    /// With the probability [`FALSE`] the measurement is false. The density of a false measurement is the same number
    /// in all hypotheses: the mean density of a usual good measurement. So a hypothesis that rejects never gains on
    /// a hypothesis that accepts, and a hypothesis with a small S does not win without evidence.
    ///
    /// A hypothesis that says nothing keeps its share: it gets the mean density of the others, in which a measurement
    /// that is false for them counts as false for it too.
    fn weigh(&mut self, before: f64, offer: &Offer<'_, '_>) {
        if before == f64::NEG_INFINITY {
            return;
        }
        let usual = self.hypotheses.iter().filter_map(|h| match h.report.weighed {
            Weighed::Good { usual, .. } => Some(h.weight + usual),
            _ => None,
        });
        let of_false = usual.reduce(log_sum).map_or(0.0, |usual| usual - before);
        let floor = of_false + math::ln(FALSE);
        let mean = |h: &Hypothesis| match h.report.weighed {
            Weighed::Nothing => None,
            Weighed::Good { density, .. } if density < floor => Some(h.weight + of_false),
            Weighed::Good { density, .. } => Some(h.weight + density),
            _ => Some(h.weight),
        };
        let share = self
            .hypotheses
            .iter()
            .filter_map(mean)
            .reduce(log_sum)
            .map_or(0.0, |all| all - before);
        for k in 0..self.hypotheses.len() {
            self.hypotheses[k].report.is_in_doubt = self.hypotheses[k].report.verdict == Verdict::Rejected && self.is_in_doubt(k);
        }
        for k in 0..self.hypotheses.len() {
            let hypothesis = &mut self.hypotheses[k];
            let weight = hypothesis.weight;
            hypothesis.weight += match hypothesis.report.weighed {
                Weighed::Nothing => share,
                Weighed::Good { density, .. } => density.max(floor),
                _ => 0.0,
            };
            if let Weighed::Good { density, .. } = hypothesis.report.weighed
                && hypothesis.report.is_in_doubt
                && density > floor - offer.depth
                && self.overrule(k, weight + density, offer)
            {
                self.hypotheses[k].weight = weight + floor;
            }
        }
    }

    /// Whether it is more probable that another start is the true one, instead of hypothesis number `k`, than that
    /// a measurement is false. Hypotheses belong to one start if their angles differ by less than the 1σ of a start.
    fn is_in_doubt(&mut self, k: usize) -> bool {
        let sigma = 0.5 * TAU / self.limits.starts as f64;
        let least = self.hypotheses[k].weight + math::ln(FALSE);
        (0..self.hypotheses.len()).any(|other| self.hypotheses[other].weight > least && self.apart(k, other) > sigma)
    }

    /// Continues hypothesis number `k`, whose gate has rejected the measurement, also with the measurement in use. A
    /// gate trusts its estimate. If it is more probable that another start is the true one than that a measurement is
    /// false, the estimate may be wrong: a hypothesis that rejects a good measurement may reject all that follow.
    /// Returns whether that was possible.
    fn overrule(&mut self, k: usize, weight: f64, offer: &Offer<'_, '_>) -> bool {
        let answer = self.hypotheses[k].report.answer;
        let Some(mut child) = self.fork(k) else { return false };
        child.update(Intent::Overrule(answer), offer);
        child.weight = weight;
        let is_used = child.report.is_used();
        let list = if is_used { &mut self.hypotheses } else { &mut self.spare };
        list.push(child);
        is_used
    }

    /// Drops improbable hypotheses and twins, and chooses the hypothesis to show.
    fn select(&mut self) {
        // A stable sort of many would allocate.
        let order = |a: &Hypothesis, b: &Hypothesis| b.weight.total_cmp(&a.weight).then(b.is_successor.cmp(&a.is_successor));
        self.hypotheses.sort_unstable_by(order);
        let best = self.hypotheses[0].weight;
        let least = best + math::ln(self.limits.least);
        while self.hypotheses.last().is_some_and(|h| h.weight <= least) {
            self.spare.extend(self.hypotheses.pop());
        }
        self.merge();
        while self.hypotheses.len() > self.limits.most.max(1) {
            self.spare.extend(self.hypotheses.pop());
        }
        let best = self.hypotheses[0].weight;
        self.hypotheses.iter_mut().for_each(|h| h.weight -= best);
        let stays = self
            .successor()
            .filter(|s| self.hypotheses[*s].weight >= -math::ln(self.limits.switch));
        self.shown = stays.unwrap_or(0);
        self.rivals.changed = match (stays, self.successor()) {
            (None, Some(before)) => Some(self.apart(0, before)),
            (None, None) => Some(f64::NAN),
            (Some(_), _) => None,
        };
        let shown = &mut self.hypotheses[self.shown];
        if stays.is_none() && shown.report.may_be_false && shown.report.verdict == Verdict::Accepted {
            // The estimate jumps to the hypothesis that accepted this sensor.
            shown.report.verdict = Verdict::Reacquired;
        }
        let rejects = |h: &Hypothesis| h.report.verdict == Verdict::Rejected && matches!(h.report.weighed, Weighed::Good { .. });
        self.rivals.rejected = self.hypotheses.iter().all(rejects);
        for (k, hypothesis) in self.hypotheses.iter_mut().enumerate() {
            hypothesis.is_successor = k == self.shown;
        }
        self.compare();
    }

    /// How far apart the hypotheses are.
    fn compare(&mut self) {
        let (mut squares, mut all) = (0.0, 0.0);
        for k in 0..self.hypotheses.len() {
            let probability = math::exp(self.hypotheses[k].weight);
            all += probability;
            if k != self.shown {
                squares += probability * math::powi(self.apart(self.shown, k), 2);
            }
        }
        let shown = math::exp(self.hypotheses[self.shown].weight);
        self.rivals.count = self.hypotheses.len();
        (self.rivals.probability, self.rivals.apart) = if all > 0.0 {
            (shown / all, math::sqrt(squares / all))
        } else {
            (1.0, 0.0)
        };
    }

    /// How far apart two hypotheses are, in the attitude or angle that differs most \[rad\].
    fn apart(&mut self, a: usize, b: usize) -> f64 {
        let [a, b] = [a, b].map(|k| &self.hypotheses[k].estimator);
        Body.difference(a.layout(), &a.belief().x, &b.belief().x, &mut self.delta);
        // A number in radians does not know of full turns.
        let apart = |axis: &usize| self.delta[*axis] - TAU * math::round(self.delta[*axis] / TAU);
        self.angles.iter().map(|axis| apart(axis).abs()).fold(0.0, f64::max)
    }

    /// The most probable hypothesis that continues the one shown. Of two continuations after a measurement it prefers
    /// the rejection, unless acceptance is more probable by [`SURE`]: a missed measurement costs less than
    /// a false one.
    fn successor(&self) -> Option<usize> {
        let mut successors = self.hypotheses.iter().enumerate().filter(|(_, h)| h.is_successor);
        let (first, best) = successors.next()?;
        let without = successors.find(|(_, h)| best.report.is_used() && !h.report.is_used());
        let is_near = |h: &Hypothesis| h.weight > best.weight - math::ln(SURE);
        Some(without.filter(|(_, h)| is_near(h)).map_or(first, |(k, _)| k))
    }

    /// Merges hypotheses that are alike: the most probable stays, with the sum of their weights.
    fn merge(&mut self) {
        let mut k = 1;
        while k < self.hypotheses.len() {
            let (before, rest) = self.hypotheses.split_at_mut(k);
            let twin = before.iter_mut().find(|h| is_alike(h, &rest[0], &mut self.delta));
            match twin {
                Some(twin) => {
                    twin.weight = log_sum(twin.weight, rest[0].weight);
                    twin.is_successor |= rest[0].is_successor;
                    self.drop(k);
                }
                None => k += 1,
            }
        }
    }

    /// Moves every hypothesis. A hypothesis that fails is dropped, unless it is the last.
    fn move_all(&mut self, to_move: impl Fn(&mut dyn Estimator) -> Result<(), FilterError>) -> Result<(), FilterError> {
        let mut failed = Ok(());
        let mut k = 0;
        while k < self.hypotheses.len() {
            match to_move(self.hypotheses[k].estimator.as_mut()) {
                Ok(()) => k += 1,
                Err(error) if self.hypotheses.len() == 1 => return Err(error),
                Err(error) => {
                    failed = if k == self.shown { Err(error) } else { failed };
                    self.drop(k);
                    self.shown = match self.shown {
                        shown if shown > k => shown - 1,
                        shown if shown == k => 0,
                        shown => shown,
                    };
                }
            }
        }
        self.shown = self.shown.min(self.hypotheses.len() - 1);
        failed
    }
}

/// Whether no axis of `b` is further from `a` than a small part of the σ of `a`.
fn is_alike(a: &Hypothesis, b: &Hypothesis, delta: &mut [f64]) -> bool {
    let (x, y) = (a.estimator.belief(), b.estimator.belief());
    Body.difference(a.estimator.layout(), &y.x, &x.x, delta);
    let is_near = |(axis, d): (usize, &f64)| d.abs() <= ALIKE * math::sqrt(x.covariance.variance(axis));
    delta.iter().enumerate().all(is_near)
}

impl Memory for Bank {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        let count = tape.length(self.hypotheses.len(), 1);
        if count == 0 || count > self.hypotheses.len() + self.spare.len() {
            tape.refuse("a bank has no such number of hypotheses");
            return;
        }
        while self.hypotheses.len() > count {
            self.spare.extend(self.hypotheses.pop());
        }
        while self.hypotheses.len() < count {
            self.hypotheses.extend(self.spare.pop());
        }
        self.hypotheses[..].remember(tape);
        self.shown.remember(tape);
        self.rivals.probability.remember(tape);
        self.rivals.apart.remember(tape);
        self.rivals.count = count;
        if self.shown >= count {
            self.shown = 0;
            tape.refuse("the hypothesis shown does not exist");
        }
    }
}

impl Estimator for Bank {
    fn belief(&self) -> &Belief {
        self.hypotheses[self.shown].estimator.belief()
    }

    fn layout(&self) -> &Arc<Layout> {
        self.hypotheses[self.shown].estimator.layout()
    }

    fn keeps_covariance(&self) -> bool {
        self.hypotheses[self.shown].estimator.keeps_covariance()
    }

    fn set_belief(&mut self, belief: Belief) {
        self.hypotheses.swap(0, self.shown);
        self.shown = 0;
        while self.hypotheses.len() > 1 {
            self.spare.extend(self.hypotheses.pop());
        }
        let first = &mut self.hypotheses[0];
        (first.weight, first.is_successor) = (0.0, true);
        first.outcomes.fill(None);
        self.rivals = Rivals::NONE;
        let starts = headings(&belief, first.estimator.layout(), self.limits.starts.min(self.limits.most));
        let Some(starts) = starts else {
            first.estimator.set_belief(belief);
            return;
        };
        for (k, (belief, weight)) in starts.into_iter().enumerate() {
            if k > 0 {
                let Some(mut other) = self.fork(0) else { return };
                other.is_successor = false;
                self.hypotheses.push(other);
            }
            self.hypotheses[k].weight = weight;
            self.hypotheses[k].estimator.set_belief(belief);
        }
        self.compare();
    }

    fn predict(&mut self, to: Time, input: &Input<'_>) -> Result<(), FilterError> {
        self.move_all(|estimator| estimator.predict(to, input))
    }

    fn coast(&mut self, to: Time, missing: f64, expected: Option<&Input<'_>>) -> Result<(), FilterError> {
        self.move_all(|estimator| estimator.coast(to, missing, expected))
    }

    fn update<'a>(&'a mut self, observed: &Observed<'a>, _: &mut dyn Gate, others: &[Option<Outcome>], loss: &dyn Loss) -> Update<'a> {
        let size = observed.model.size();
        let offer = Offer {
            observed,
            loss,
            depth: -math::ln(self.limits.doubt),
        };
        let mut before = f64::NEG_INFINITY;
        for k in 0..self.hypotheses.len() {
            self.hypotheses[k].foresee(others);
            let weight = self.hypotheses[k].weight;
            self.branch(k, &offer);
            if !matches!(self.hypotheses[k].report.weighed, Weighed::Nothing) {
                before = log_sum(before, weight);
            }
        }
        self.weigh(before, &offer);
        self.select();
        let report = &self.hypotheses[self.shown].report;
        Update {
            verdict: report.verdict,
            value: &observed.value[..size.value],
            predicted: &report.predicted,
            noise: &observed.noise[..size.residual * size.residual],
            residual: &report.residual,
            innovation_sigma: &report.sigma,
            innovation_factor: &report.factor,
            nis: report.nis,
            statistic: report.answer.statistic,
            threshold: report.answer.threshold,
            mode: report.answer.mode,
            power: &report.power,
            weight: report.weight,
            rivals: self.rivals,
            jacobian: self.hypotheses[self.shown].estimator.jacobian(),
        }
    }

    fn rivals(&self) -> Rivals {
        self.rivals
    }

    fn view(&mut self) -> View<'_> {
        self.hypotheses[self.shown].estimator.view()
    }

    fn keep_steps(&mut self, keep: bool) {
        self.hypotheses.iter_mut().for_each(|h| h.estimator.keep_steps(keep));
    }

    fn steps(&self) -> &[Step] {
        self.hypotheses[self.shown].estimator.steps()
    }
}
