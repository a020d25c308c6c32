//! Fixed parameters of sensors against what the design's own filter makes of them where they are states.
//!
//! All are states at once, in one more run: each starts from what is declared, with a σ that a careful guess would have.
//! What cannot be told apart stays uncertain, and nothing is said of it.

use super::judge::{Comparison, Judged};
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{Design, Named, SensorDesign, parameters};
use crate::observe::{Heard, RunEvent, RunObserver};
use crate::present::short;
use crate::run::{Options, Run, Smoothing, examine};
use fusion_core::runner::Halt;
use fusion_core::state::{Belief, Block, Kind};
use fusion_core::time::Time;
use fusion_models::units::{Vec3Of, dim};
use serde_json::Value as Json;

/// An arm that is so many σ on the other side of zero points there. Latencies that are not declared, and errors that are
/// correlated, move an estimate by several σ.
const MIRRORED: f64 = 10.0;
/// An arm that is declared, and so many σ elsewhere, is another one.
const CERTAIN: f64 = 6.0;
/// From so many σ on it is said why nothing is told.
const NOTABLE: f64 = 3.0;
/// A σ that is not below so much of its first one tells nothing.
const LEARNT: f64 = 1.0 / 3.0;
/// An estimate that goes so many of its first σ away is no estimate: the filter is.
const ASTRAY: f64 = 4.0;
/// In the second half of the data an estimate stays within so much of its way: what goes on moving follows something else.
const STEADY: f64 = 0.3;
/// Estimates are looked at no more often than this \[s\].
const PERIOD: f64 = 1.0;
/// The sign of a lever arm no longer than this matters to nobody \[m\].
const SHORTEST: f64 = 0.1;
const ARM: &str = "lever_arm";

/// A kind of parameter that is tried.
#[derive(Clone, Copy, Debug)]
struct Sort {
    /// The unit that it is shown in, as the schema writes it, and what that is in SI.
    unit: &'static str,
    si: f64,
    /// 1σ of a careful guess, in that unit.
    sigma: f64,
    /// The least error that matters, in that unit.
    least: f64,
    /// An estimate that is so many σ away is no chance. The σ is the filter's own, which takes its noise for white.
    certain: f64,
}

/// What is fixed by how a sensor is made and mounted: slow errors are no such thing.
///
/// Slow errors of fixes look like a lever arm: on the recorded log of a robot whose receiver wanders by metres they make 19σ of
/// one. Stamps of a clock of their own look like a latency.
const SORTS: [Sort; 5] = [
    Sort {
        unit: "deg",
        si: std::f64::consts::PI / 180.0,
        sigma: 10.0,
        least: 2.0,
        certain: 5.0,
    },
    Sort {
        unit: "%",
        si: 0.01,
        sigma: 10.0,
        least: 2.0,
        certain: 5.0,
    },
    Sort {
        unit: "s",
        si: 1.0,
        sigma: 0.3,
        least: 0.05,
        certain: 6.0,
    },
    Sort {
        unit: "m",
        si: 1.0,
        sigma: 1.0,
        least: 0.5,
        certain: 30.0,
    },
    Sort {
        unit: "uT",
        si: 1e-6,
        sigma: 10.0,
        least: 2.0,
        certain: 10.0,
    },
];

/// A parameter that is tried as a state.
struct Tried<'a> {
    sensor: &'a Named<SensorDesign>,
    key: String,
    sort: Sort,
    /// As it is declared, for TOML.
    declared: String,
    sigma: f64,
    is_rotation: bool,
    is_state: bool,
}

impl Tried<'_> {
    fn is_arm(&self) -> bool {
        self.key == ARM
    }

    fn name(&self) -> String {
        format!("{}.{}", self.sensor.name, self.key)
    }

    fn assignment(&self) -> String {
        let Self { key, declared, sigma, .. } = self;
        let (name, unit) = (&self.sensor.name, self.sort.unit);
        format!("sensor.{name}.{key}={{ estimate = true, initial = {declared}, sigma = \"{sigma} {unit}\" }}")
    }
}

/// Estimates what a design declares as fixed, and compares.
pub(super) fn judge(design: &Design, options: &Options, found: &mut Judged) -> Result<(), Diagnostics> {
    let sources: Vec<&str> = design.sources.iter().map(|source| source.name.as_str()).collect();
    let all: Vec<Tried<'_>> = design.sensors.iter().flat_map(|sensor| of_sensor(sensor, &sources)).collect();
    // Where some together are no design, or lead the filter astray, the arms alone are tried.
    let arms: Vec<&Tried<'_>> = all.iter().filter(|tried| tried.is_arm()).collect();
    let all: Vec<&Tried<'_>> = all.iter().collect();
    let options = Options {
        data: options.data.clone(),
        base: options.base.clone(),
        seed: options.seed,
        smooth: Smoothing::Never,
        ..Options::default()
    };
    let mut is_astray = false;
    for tried in [all, arms].into_iter().filter(|tried| !tried.is_empty()) {
        let mut document = design.document.clone();
        if tried.iter().try_for_each(|t| document.set(&t.assignment())).is_err() {
            continue;
        }
        let Ok(free) = examine::build(document) else { continue };
        let mut course = Course::default();
        Run::open(&free, &options)?.go(&mut [&mut course], &mut |_| {})?.keep()?;
        let estimates: Vec<_> = tried.iter().filter_map(|t| Some((*t, course.estimate(&t.name())?))).collect();
        if !estimates.iter().any(|(_, e)| e.is_astray) {
            // What the data tell nothing of is named, no more; declared arms were always listed.
            let is_listed = |(tried, e): &&(&Tried<'_>, Estimate)| {
                let is_declared_arm = tried.is_arm() && (0..3).any(|k| (e.value[k] - e.difference[k]).abs() >= SHORTEST);
                is_declared_arm || e.is_learnt.contains(&true)
            };
            let (listed, unknown): (Vec<_>, Vec<_>) = estimates.iter().partition(is_listed);
            listed.into_iter().for_each(|(tried, estimate)| compare(tried, estimate, found));
            let unknown: Vec<String> = unknown.into_iter().map(|(tried, _)| tried.name()).collect();
            if !unknown.is_empty() {
                found
                    .comparisons
                    .push(untried(&format!("these data tell too little of {}", unknown.join(", "))));
            }
            return Ok(());
        }
        is_astray = true;
    }
    if is_astray {
        found.comparisons.push(untried(
            "not decided: as states they lead the filter astray, so something else is wrong",
        ));
    }
    Ok(())
}

/// What is said where none was tried.
pub(super) fn untried(why: &str) -> Comparison {
    Comparison {
        what: "fixed parameters".to_owned(),
        with: "the estimate of this filter".to_owned(),
        samples: 0,
        correlation: Vec::new(),
        margin: 0.0,
        verdict: why.to_owned(),
    }
}

/// What is fixed of a sensor, and of a kind that is tried.
fn of_sensor<'a>(sensor: &'a Named<SensorDesign>, sources: &[&str]) -> Vec<Tried<'a>> {
    let has_source = sources.contains(&sensor.node.get("source").and_then(Node::as_str).unwrap_or_default());
    let of = |(key, schema): (String, Json)| {
        let sigma = with(&schema, &|schema| schema["properties"].get("sigma").cloned())?;
        let example = with(&sigma, &|schema| schema["examples"][0].as_str().map(str::to_owned).map(Json::from))?;
        let (_, unit) = example.as_str()?.rsplit_once(' ')?;
        let sort = *SORTS.iter().find(|sort| sort.unit == unit)?;
        let has_axes = with(&sigma, &|schema| schema.get("minItems").cloned()).is_some();
        let node = sensor.node.get(&key);
        let constant = match node.map(|node| (node, node.get("initial"))) {
            Some((_, Some(initial))) if key == ARM || !is_state(node?) => Some(initial),
            Some((_, Some(_))) => return None,
            Some((node, None)) if node.get("shared").is_some() => return None,
            Some((node, None)) => Some(node),
            None => None,
        };
        // The sign of an arm that is a state is tried too, from further away than it may go.
        let is_state = node.is_some_and(is_state);
        if is_state && length(constant) < SHORTEST {
            return None;
        }
        let zero = || if has_axes { "[0, 0, 0]" } else { "0" }.to_owned();
        // A slow error of a length, as the bias of a range, is no arm; what a stage makes has none but a declared one.
        let is_meant = sort.unit != "m" || key == ARM && (has_source || length(constant) >= SHORTEST);
        is_meant.then(|| Tried {
            sensor,
            declared: constant.map_or_else(zero, Node::inline),
            sigma: if key == ARM {
                2.0 * length(constant).max(sort.sigma / 2.0)
            } else {
                sort.sigma
            },
            is_rotation: has_axes && sort.unit == "deg",
            is_state,
            key,
            sort,
        })
    };
    parameters(&sensor.node).into_iter().filter_map(of).collect()
}

/// Whether a parameter is estimated.
fn is_state(node: &Node) -> bool {
    node.get("estimate").is_some_and(|e| e.inline() == "true")
}

/// The length of a declared arm \[m\].
fn length(arm: Option<&Node>) -> f64 {
    let arm: Option<Vec3Of<dim::Length>> = arm.and_then(|n| n.read(&mut Diagnostics::new()));
    arm.map_or(0.0, |arm| arm.si().iter().map(|l| l * l).sum::<f64>().sqrt())
}

/// What `read` finds first within a schema.
fn with(schema: &Json, read: &dyn Fn(&Json) -> Option<Json>) -> Option<Json> {
    read(schema).or_else(|| match schema {
        Json::Object(fields) => fields.values().find_map(|field| with(field, read)),
        Json::Array(items) => items.iter().find_map(|item| with(item, read)),
        _ => None,
    })
}

/// How the parameters of the outermost filter go on.
#[derive(Debug, Default)]
struct Course {
    blocks: Vec<Block>,
    initial: Vec<f64>,
    /// Time, state, and 1σ of each axis.
    told: Vec<(Time, Vec<f64>, Vec<f64>)>,
}

/// What became of a parameter: by axis the difference from what is declared, and the sum of both, which of a rotation is the
/// difference alone.
struct Estimate {
    difference: Vec<f64>,
    value: Vec<f64>,
    sigma: Vec<f64>,
    /// Whether the 1σ has become so much smaller that something was learnt.
    is_learnt: Vec<bool>,
    /// Whether it stays near its last value in the second half.
    is_steady: Vec<bool>,
    /// Whether it went further than its first 1σ allows.
    is_astray: bool,
}

impl Course {
    fn look(&mut self, filter: &Heard, belief: &Belief) {
        if self.blocks.is_empty() {
            self.blocks = filter.layout.blocks().to_vec();
            self.initial = filter.layout.initial().to_vec();
        }
        let sigmas = self.blocks.iter().flat_map(|b| belief.covariance.sigmas(b)).collect();
        self.told.push((belief.time, belief.x.clone(), sigmas));
    }

    fn estimate(&self, name: &str) -> Option<Estimate> {
        let block = self.blocks.iter().find(|b| b.name == name)?;
        let ((start, ..), (end, last, sigma)) = (self.told.first()?, self.told.last()?);
        let initial = &self.initial[block.storage_range()];
        let from_declared = |x: &[f64]| {
            let mut out = vec![0.0; block.tangent_range().len()];
            block.kind.minus(&x[block.storage_range()], initial, &mut out);
            out
        };
        let difference = from_declared(last);
        let half = end.seconds_since(*start) / 2.0;
        let second = self.told.iter().filter(|(t, ..)| end.seconds_since(*t) <= half);
        let second: Vec<Vec<f64>> = second.map(|(_, x, _)| from_declared(x)).collect();
        let is_steady = |k: usize| second.iter().all(|d| (d[k] - difference[k]).abs() <= STEADY * difference[k].abs());
        let sigma = sigma[block.tangent_range()].to_vec();
        let is_learnt = |(sigma, first): (&f64, &f64)| *sigma > 0.0 && *sigma < LEARNT * first;
        Some(Estimate {
            value: if block.kind == Kind::Attitude {
                difference.clone()
            } else {
                last[block.storage_range()].to_vec()
            },
            is_learnt: sigma.iter().zip(&block.sigma).map(is_learnt).collect(),
            is_steady: (0..difference.len()).map(is_steady).collect(),
            is_astray: difference.iter().zip(&block.sigma).any(|(d, first)| d.abs() > ASTRAY * first),
            difference,
            sigma,
        })
    }
}

impl RunObserver for Course {
    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Estimate { filter, belief, .. } = event
            && filter.is_outermost()
            && self.told.last().is_none_or(|(t, ..)| belief.time.seconds_since(*t) >= PERIOD)
        {
            self.look(filter, belief);
        }
        Ok(())
    }
}

/// What is said of an axis of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Fits,
    /// The other sign is declared.
    Mirrored,
    /// Another value is.
    Other,
}

impl Tried<'_> {
    fn verdict(&self, e: &Estimate, k: usize) -> Verdict {
        let declared = e.value[k] - e.difference[k];
        if self.is_arm() && declared.abs() >= SHORTEST {
            let is_far = e.value[k].abs() > MIRRORED * e.sigma[k] && e.value[k].abs() > declared.abs() / 2.0;
            if is_far && e.value[k] * declared < 0.0 {
                return Verdict::Mirrored;
            }
        }
        if !self.is_state && e.is_learnt[k] && self.doubts(e, k).is_none() {
            Verdict::Other
        } else {
            Verdict::Fits
        }
    }

    /// Standard errors from which on another value is told: of what is left out less is claimed than of what is declared.
    fn certain(&self, declared: f64) -> f64 {
        if self.is_arm() && declared.abs() >= SHORTEST {
            CERTAIN
        } else {
            self.sort.certain
        }
    }

    /// Why a difference is not told.
    fn doubts(&self, e: &Estimate, k: usize) -> Option<String> {
        let (sort, by) = (self.sort, e.difference[k].abs());
        let (times, certain) = (by / e.sigma[k], self.certain(e.value[k] - e.difference[k]));
        if by < sort.least * sort.si {
            return Some(format!("within {} {} of what is declared", sort.least, sort.unit));
        }
        if times < certain {
            return Some(format!("{times:.1} σ from what is declared, {certain:.0} σ would be told"));
        }
        // Nothing is measured before it is.
        if sort.unit == "s" && e.value[k] < -sort.least {
            return Some("a negative delay is none".to_owned());
        }
        (!e.is_steady[k]).then(|| "it goes on moving".to_owned())
    }

    /// Values in its unit, as they are read, with two digits of their σ.
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
    let digits = if sigma > 0.0 { 1 - sigma.log10().floor() as i32 } else { 2 };
    let text = format!("{value:.*}", digits.clamp(0, 9) as usize);
    // What rounds to zero has no sign.
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.strip_prefix('-').filter(|_| is_zero).map_or(text.clone(), str::to_owned)
}

fn compare(tried: &Tried<'_>, e: &Estimate, found: &mut Judged) {
    let verdicts: Vec<Verdict> = (0..e.difference.len()).map(|k| tried.verdict(e, k)).collect();
    let unit = tried.sort.unit;
    let words = format!(
        "{} {unit}, 1σ {} {unit}",
        tried.shown(&e.value, &e.sigma),
        tried.shown(&e.sigma, &e.sigma)
    );
    let away = |k: usize| if e.is_learnt[k] { e.difference[k].abs() / e.sigma[k] } else { 0.0 };
    let is_mirrored = verdicts.contains(&Verdict::Mirrored);
    let found_other = is_mirrored || verdicts.contains(&Verdict::Other);
    // Of the axis that is furthest away, why nothing is said.
    let furthest = (0..verdicts.len()).max_by(|a, b| away(*a).total_cmp(&away(*b)));
    let why = furthest.filter(|k| away(*k) > NOTABLE && !tried.is_state);
    let why = why
        .and_then(|k| tried.doubts(e, k))
        .map_or_else(String::new, |why| format!("; no warning: {why}"));
    found.comparisons.push(Comparison {
        what: tried.name(),
        with: "the estimate of this filter".to_owned(),
        samples: 0,
        correlation: Vec::new(),
        margin: (0..verdicts.len())
            .filter(|k| verdicts[*k] != Verdict::Fits)
            .map(away)
            .fold(0.0, f64::max),
        verdict: match (is_mirrored, found_other) {
            (true, _) => format!("another sign: {words}"),
            (_, true) => format!("another value: {words}"),
            _ => words.clone() + &why,
        },
    });
    if is_mirrored {
        found.mistakes.push(mirrored(tried, e, &verdicts, &words));
    } else if found_other {
        found.mistakes.push(other(tried, e, &words));
    }
}

/// An arm that points to the other side.
fn mirrored(tried: &Tried<'_>, e: &Estimate, verdicts: &[Verdict], words: &str) -> Diagnostic {
    let node = &tried.sensor.node;
    let axes: Vec<&str> = (0..3)
        .filter(|k| verdicts[*k] == Verdict::Mirrored)
        .map(|k| ["x", "y", "z"][k])
        .collect();
    let sign = |k: usize| if verdicts[k] == Verdict::Mirrored { -1.0 } else { 1.0 };
    // As it is declared: sums and differences of it leave 1e-17.
    let arm: Vec<String> = (0..3)
        .map(|k| format!("\"{} m\"", short(sign(k) * (e.value[k] - e.difference[k]))))
        .collect();
    let key = if node.at(&format!("{ARM}.initial")).is_some() {
        "initial"
    } else {
        ARM
    };
    let message = format!(
        "the lever arm of `{}` has the wrong sign along {}: where it is estimated, it becomes {words}",
        tried.sensor.name,
        axes.join(" and ")
    );
    let help = format!(
        "it points from the body origin to the sensor, forward, right, down: try `{key} = [{}]`",
        arm.join(", ")
    );
    Diagnostic::warning(message).at(node.place_of(ARM)).help(help)
}

/// A parameter that is declared, or left out, as what it is not.
fn other(tried: &Tried<'_>, e: &Estimate, words: &str) -> Diagnostic {
    let Tried { sensor, key, sort, .. } = tried;
    let (place, is) = match sensor.node.get(key) {
        Some(node) => (node.place(), format!("is declared as {}", tried.declared)),
        None => (sensor.node.place(), "is left out".to_owned()),
    };
    let becomes = if tried.is_rotation { "is turned further by" } else { "becomes" };
    let message = format!(
        "`{key}` of `{}` {is}, and the data say otherwise: where it is estimated, it {becomes} {words}",
        sensor.name
    );
    // A rotation is told as what turns the declared one.
    let initial = if tried.is_rotation {
        tried.declared.clone()
    } else {
        tried.written(&e.value, &e.sigma)
    };
    let help = format!(
        "try it as a state: `{key} = {{ estimate = true, initial = {initial}, sigma = \"{} {}\" }}`; where it then stays, and the \
         consistency is better, it is so, or something else that acts like it",
        sort.sigma, sort.unit
    );
    Diagnostic::warning(message).at(place).help(help)
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
