//! The message about a parameter, or the reason for no message.

use super::course::{Course, Estimate, STEPS};
use super::parameter::{ARM, Other, SHORTEST, Start, Tried};
use super::search::{What, Written};
use crate::findings::level::{sigmas, standard_errors};
use crate::frames::compare::sized;
use crate::frames::judge::{Comparison, Judged};
use crate::frames::mistake::{self, Remedy};
use fusion::config::{Diagnostic, Node};
use fusion::design::{Design, Named, SensorDesign, parameters};
use fusion_core::math;
use fusion_tables::short;

/// A 1σ is reported as widened if it exceeds the filter's own by this factor.
const WIDENED: f64 = 1.5;
/// A declared noise of this many times the scatter of the innovations leaves a sensor without weight.
const OVERSIZED: f64 = 3.0;
/// An estimate that moves by more than this multiple of its initial σ has another cause. The initial σ of a declared
/// arm is twice its length.
const NEAR: f64 = 2.5;

/// The number of displayed 1σ at which a difference is significant. The steps between the parts of a run give the 1σ.
fn sure() -> f64 {
    standard_errors(1, STEPS)
}

/// The verdict on an axis of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Fits,
    /// The other sign is declared.
    Mirrored,
    /// Another value is declared.
    Other,
}

impl Tried<'_> {
    pub(super) fn verdict(&self, e: &Estimate, k: usize) -> Verdict {
        let declared = e.declared(k);
        if self.is_arm() && declared.abs() >= SHORTEST {
            let is_far = e.value[k].abs() > sure() * e.sigma[k] && e.value[k].abs() > declared.abs() / 2.0;
            let is_claimed = e.difference[k].abs() > sigmas(1) * self.prior[k];
            if is_far && is_claimed && e.value[k] * declared < 0.0 && e.is_near() {
                return Verdict::Mirrored;
            }
        }
        if self.is_judged() && e.is_learnt[k] && self.doubts(e, k).is_none() {
            Verdict::Other
        } else {
            Verdict::Fits
        }
    }

    /// Returns true if the latency is shorter than declared.
    pub(super) fn is_earlier(&self, e: &Estimate) -> bool {
        let by = e.difference[0];
        self.sort.unit == "s" && e.is_learnt[0] && by < -self.sort.least && by < -sure() * e.sigma[0]
    }

    /// Returns true if the total delay would be negative. Then the clock of the process is late.
    pub(super) fn is_early(&self, e: &Estimate) -> bool {
        self.is_earlier(e) && self.delay_of(e) < -self.sort.least
    }

    /// The total delay: the declared delays of the sensor and its source, plus the estimated difference \[s\].
    fn delay_of(&self, e: &Estimate) -> f64 {
        e.value[0] + self.delay
    }

    /// The reason why a difference is not reported.
    fn doubts(&self, e: &Estimate, k: usize) -> Option<String> {
        let (sort, by) = (self.sort, e.difference[k].abs());
        let (times, sure) = (by / e.sigma[k], sure());
        if by < sort.least * sort.si {
            // Small, but certain. For a scale, shows its effect; for others, shows that a state would find it.
            let matters = match sort.unit {
                _ if times <= sure => String::new(),
                "%" => format!(", but {:.0} m in 1 km", by * 1e3),
                _ => format!(", but {times:.0} σ from it, so the filter would find it as a state"),
            };
            return Some(format!("within {} {} of what is declared{matters}", sort.least, sort.unit));
        }
        if times < sure {
            return Some(format!("{times:.1} σ from what is declared, {sure:.0} would be reported"));
        }
        if self.is_arm() && !e.is_near() && (0..3).any(|k| e.declared(k).abs() >= SHORTEST) {
            return Some("it goes further than an arm of this vehicle".to_owned());
        }
        // A measurement cannot arrive before it is made.
        if sort.unit == "s" && self.delay_of(e) < -sort.least {
            return Some("the delay would be negative in all, so another clock may be late".to_owned());
        }
        (!e.is_steady[k]).then(|| "it goes on moving".to_owned())
    }

    /// Values in the unit of the parameter, for people, with two digits of their σ.
    fn shown(&self, values: &[f64], sigma: &[f64]) -> String {
        let words = self.rounded(values, sigma);
        match &words[..] {
            [one] => one.clone(),
            words => format!("[{}]", words.join(", ")),
        }
    }

    /// Values as they are written in TOML.
    fn written(&self, values: &[f64], sigma: &[f64]) -> String {
        let unit = self.sort.unit;
        let words: Vec<String> = self.rounded(values, sigma).iter().map(|v| format!("\"{v} {unit}\"")).collect();
        match &words[..] {
            [one] => one.clone(),
            words => format!("[{}]", words.join(", ")),
        }
    }

    fn rounded(&self, values: &[f64], sigma: &[f64]) -> Vec<String> {
        let pairs = values.iter().zip(sigma);
        pairs.map(|(v, sigma)| rounded(v / self.sort.si, sigma / self.sort.si)).collect()
    }
}

/// A value to two digits of its σ.
fn rounded(value: f64, sigma: f64) -> String {
    let digits = if sigma > 0.0 {
        1 - math::floor(math::log10(sigma)) as i32
    } else {
        2
    };
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    // A value that rounds to zero has no sign.
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.strip_prefix('-').filter(|_| is_zero).map_or(text.clone(), str::to_owned)
}

impl Estimate {
    /// Returns true if a linear filter may find the estimate.
    pub(super) fn is_near(&self) -> bool {
        self.away <= NEAR
    }

    /// The largest factor by which a 1σ is wider than the filter's own.
    fn widened(&self) -> f64 {
        let factors = self.sigma.iter().zip(&self.own).map(|(sigma, own)| sigma / own);
        factors.filter(|factor| factor.is_finite()).fold(1.0, f64::max)
    }

    fn is_widened(&self) -> bool {
        self.widened() >= WIDENED
    }

    /// The standard errors of an axis, if the data carry information about it.
    fn errors(&self, k: usize) -> f64 {
        if self.is_learnt[k] {
            self.difference[k].abs() / self.sigma[k]
        } else {
            0.0
        }
    }
}

/// An entry in the list of comparisons.
pub(super) fn listed(what: String, margin: f64, verdict: String) -> Comparison {
    Comparison {
        margin,
        ..Comparison::plain(what, "the estimate of this filter", 0, verdict)
    }
}

impl Tried<'_> {
    /// An estimate in words.
    fn words(&self, e: &Estimate) -> String {
        let unit = self.sort.unit;
        let widened = if e.is_widened() {
            format!(", up to {:.1} times the filter's own: so far the estimate moves", e.widened())
        } else {
            String::new()
        };
        format!(
            "{} {unit}, 1σ {} {unit}{widened}",
            self.shown(&e.value, &e.sigma),
            self.shown(&e.sigma, &e.sigma)
        )
    }

    /// The reason why the data say little about any parameter of this sensor: its declared noise gives it no weight.
    pub(super) fn unweighed(&self, base: &Course) -> Option<String> {
        let times = base.oversized(&self.sensor.name).filter(|times| *times > OVERSIZED)?;
        let of = &self.sensor.name;
        Some(format!(
            "the noise of `{of}` is {times:.0} times the scatter of its innovations, so it hardly counts"
        ))
    }

    /// The entry for a parameter without a warning. `alone` is its estimate as the only additional state.
    pub(super) fn unsuspected(&self, e: &Estimate, alone: Option<&Estimate>, base: &Course) -> Comparison {
        // The reason for no warning, for the axis that differs most.
        let furthest = (0..e.difference.len()).max_by(|a, b| e.errors(*a).total_cmp(&e.errors(*b)));
        let furthest = furthest.filter(|k| e.errors(*k) > sigmas(1) && self.is_judged());
        let doubts = furthest.and_then(|k| self.doubts(e, k));
        let apart = alone.map(|alone| format!("the data do not tell it from others: alone it is {}", self.words(alone)));
        let why = doubts.or_else(|| self.unweighed(base).or(apart).filter(|_| furthest.is_some()));
        let why = why.map_or_else(String::new, |why| format!("; no warning: {why}"));
        listed(self.name(), 0.0, self.words(e) + &why)
    }
}

/// Reports the mistake that explains the data.
pub(super) fn tell(design: &Design, what: &What<'_>, found: &mut Judged) {
    match what {
        What::Parameter(tried, start, e) => {
            let verdicts: Vec<Verdict> = (0..e.difference.len()).map(|k| tried.verdict(e, k)).collect();
            let is_mirrored = start.is == Other::Nothing && verdicts.contains(&Verdict::Mirrored);
            let words = tried.words(e);
            let is = if is_mirrored { "another sign" } else { "another value" };
            let margin = (0..verdicts.len()).map(|k| e.errors(k)).fold(0.0, f64::max);
            found.comparisons.push(listed(tried.name(), margin, format!("{is}: {words}")));
            found.mistakes.push(match (start.is, tried.unit(e.value[0])) {
                (Other::Turned(axis, by), _) => turned(tried, start, axis, by),
                (Other::Factor(by), _) | (_, Some(by)) => factor(design, tried, by, e),
                _ if is_mirrored => mirrored(tried, e, &verdicts, &words),
                _ => other(design, tried, e, &words),
            });
        }
        What::Columns(Written { source, channel, other }) => {
            let source = &design.sources[*source];
            let name = format!("{}.{channel}", source.name);
            let message = format!("`{name}` has {}: put right, the filter follows its data much better", other.wrong);
            let told = mistake::at("sensor-columns", &source.node, channel, "column", message);
            let told = other.remedy().of(told, &format!("source.{}.channels.{channel}", source.name));
            found.comparisons.push(listed(name, f64::INFINITY, other.wrong.clone()));
            found.mistakes.push(told);
        }
        What::Clock { source, by, than } => {
            let source = &design.sources[*source];
            let message = format!(
                "the stamps of `{}` are about {:.2} s late: else `{than}` would have measured before it did",
                source.name, -by
            );
            let verdict = format!("{:.2} s late", -by);
            found
                .comparisons
                .push(listed(format!("the stamps of {}", source.name), f64::INFINITY, verdict));
            found.mistakes.push(mistake::shifted(source, *by, message, ""));
        }
    }
}

/// The axes of a sensor are turned.
fn turned(tried: &Tried<'_>, start: &Start, axis: &str, by: f64) -> Diagnostic {
    let Tried { sensor, key, .. } = tried;
    let message = format!(
        "the axes of `{}` are turned by {by:.0} deg about {axis}: so the filter follows its data much better",
        sensor.name
    );
    let written = Remedy::write(&[(key.as_str(), start.initial.clone())]).and(", or exchange the columns accordingly");
    let place = sensor.node.get(key).map_or_else(|| sensor.node.place(), Node::place);
    let told = Diagnostic::warning(message).at(place).rule("sensor-axes");
    written.of(told, &format!("sensor.{}", sensor.name))
}

/// The numbers of a sensor are too large by a factor, or have the other sign.
fn factor(design: &Design, tried: &Tried<'_>, by: f64, e: &Estimate) -> Diagnostic {
    let sensor = tried.sensor;
    let name = sensor.node.get("source").and_then(Node::as_str).unwrap_or_default();
    let source = design.sources.iter().find(|s| s.name == name);
    let reading = sensor.block.model.reading();
    let channel = reading.channels().first().map(|c| format!("channels.{}", c.name));
    let node = source.zip(channel.as_ref()).and_then(|(s, channel)| s.node.at(channel));
    let (size, help) = if by < 0.0 {
        (
            "have the wrong sign".to_owned(),
            Some(Remedy::words("change the sign of its columns")),
        )
    } else {
        let small = 1.0 / (1.0 + e.value[0]);
        (sized(small), mistake::unit(node, "velocity", small, 0.1, 1.0))
    };
    let is = if by < 0.0 { size } else { format!("are {size}") };
    let message = format!("the numbers of `{}` {is}: else the filter does not follow its data", sensor.name);
    let place = node.map_or_else(|| sensor.node.place(), Node::place);
    let told = Diagnostic::warning(message).at(place).rule("sensor-sign");
    let help = help.unwrap_or_else(mistake::check_unit);
    help.of(told, &format!("source.{name}.{}", channel.unwrap_or_default()))
}

/// An arm with the wrong sign.
fn mirrored(tried: &Tried<'_>, e: &Estimate, verdicts: &[Verdict], words: &str) -> Diagnostic {
    let node = &tried.sensor.node;
    let axes: Vec<&str> = (0..3)
        .filter(|k| verdicts[*k] == Verdict::Mirrored)
        .map(|k| ["x", "y", "z"][k])
        .collect();
    let sign = |k: usize| if verdicts[k] == Verdict::Mirrored { -1.0 } else { 1.0 };
    // Written as declared: the sums and differences leave errors of 1e-17.
    let arm: Vec<String> = (0..3).map(|k| format!("\"{} m\"", short(sign(k) * e.declared(k)))).collect();
    let key = if node.at(&format!("{ARM}.initial")).is_some() {
        "lever_arm.initial"
    } else {
        ARM
    };
    let message = format!(
        "the lever arm of `{}` has the wrong sign along {}: where it is estimated, it becomes {words}",
        tried.sensor.name,
        axes.join(" and ")
    );
    let written = Remedy::write(&[(key, format!("[{}]", arm.join(", ")))]);
    let help = written.after("it points from the body origin to the sensor, forward, right, down");
    let told = Diagnostic::warning(message).at(node.place_of(ARM)).rule("arm-sign");
    help.of(told, &format!("sensor.{}", tried.sensor.name))
}

/// A parameter whose declared value, or missing declaration, is wrong.
fn other(design: &Design, tried: &Tried<'_>, e: &Estimate, words: &str) -> Diagnostic {
    let Tried { sensor, key, sort, .. } = tried;
    let (place, is) = match sensor.node.at(key) {
        Some(node) => (node.place(), format!("is declared as {}", tried.declared)),
        None => (sensor.node.place(), "is left out".to_owned()),
    };
    let becomes = if tried.is_rotation { "is turned further by" } else { "becomes" };
    let alike: Vec<String> = tried.shared_by.iter().map(|other| format!("`{other}`")).collect();
    let and = if alike.is_empty() {
        String::new()
    } else {
        format!(", and of {} likewise", alike.join(" and "))
    };
    let message = format!(
        "`{key}` of `{}` {is}{and}, and the data say otherwise: where it is estimated, it {becomes} {words}",
        sensor.name
    );
    // A rotation is reported as a correction of the declared one.
    let initial = if tried.is_rotation {
        tried.declared.clone()
    } else {
        tried.written(&e.value, &e.sigma)
    };
    let help = if sort.unit == "s" && tried.delay != 0.0 {
        let all = rounded(tried.delay_of(e), e.sigma[0]);
        format!("`time.offset` or `latency` of its source moves its stamps too: in all the delay is {all} s; declare that at one place")
    } else {
        format!(
            "try it as a state: `{key} = {{ estimate = true, initial = {initial}, sigma = \"{} {}\" }}`; where it then stays, and \
             the consistency is better, it is so, or something else that acts like it",
            sort.sigma, sort.unit
        )
    };
    let help = match sensor.node.get("declination") {
        Some(declination) if key == "bias" => {
            format!(
                "it acts as the `declination` does, which is {}: only the sum of both is known; {help}",
                declination.inline()
            )
        }
        _ => help,
    };
    // One antenna has one arm, for all sensors that read it. The first of these sensors has the arm.
    let word = |sensor: &Named<SensorDesign>, key: &str| sensor.node.get(key).and_then(Node::as_str).map(str::to_owned);
    let is_one_receiver = |other: &Named<SensorDesign>| {
        word(other, "source") == word(sensor, "source") || word(sensor, "only_with").as_ref() == Some(&other.name)
    };
    let has_arm = |sensor: &Named<SensorDesign>| parameters(&sensor.node).iter().any(|(key, _)| key == ARM);
    let before = design.sensors.iter().take_while(|other| other.name != sensor.name);
    let beside = before
        .filter(|other| tried.is_arm() && is_one_receiver(other))
        .find(|other| has_arm(other));
    let help = match beside {
        Some(other) => format!(
            "if both read one antenna, `{0}` has its arm, and here stands `{ARM} = {{ shared = \"{0}.{ARM}\" }}`; else {help}",
            other.name
        ),
        None => help,
    };
    let help = if alike.is_empty() {
        help
    } else {
        format!(
            "{help}; one receiver has one clock, so in {} stands `{}`",
            alike.join(" and "),
            tried.shares()
        )
    };
    Diagnostic::warning(message).at(place).rule("fixed-parameter").help(help)
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn a_value_is_shown_to_two_digits_of_its_sigma() {
        for (value, sigma, shown) in [
            (0.3012, 0.0042, "0.3012"),
            (-0.12345, 0.12, "-0.12"),
            (2.861, 10.0, "3"),
            (-0.0001, 0.01, "0.000"),
            (1.0, 0.0, "1.00"),
        ] {
            assert_eq!(rounded(value, sigma), shown);
        }
    }
}
