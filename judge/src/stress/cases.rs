//! The cases of a design from the catalogue: which fault on which stream, its size, its time.
//!
//! A case is the settings that `--set` adds to the design, so that `fusion run` can repeat it.

use super::catalogue::{Catalogue, Each, Extent, Kind};
use super::survey::Survey;
use fusion::assembly::{Assembly, StreamChannel, StreamLayout, stream_of};
use fusion::config::{Diagnostic, Diagnostics, Document, Node};
use fusion::design::Design;
use fusion_core::math;
use fusion_core::time::{Time, nanos};
use fusion_models::block::{Channel, Shape};
use fusion_models::fault::{FaultContext, FaultSpec, ProvidedChannel, derive_seed};
use fusion_models::registry::{self, Role};
use fusion_models::sim::{REFERENCE, UNITS};
use fusion_models::units::{Dimension, Dimensional, dim};
use fusion_tables::Unit;
use serde::{Deserialize, Serialize};

/// A fault, or a pair of them, on a design.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Case {
    /// Its name in the catalogue; both names of a pair.
    pub fault: String,
    /// The stream, and the channel if only one is disturbed.
    pub on: String,
    /// The size, if it is a quantity.
    pub size: String,
    /// The settings that `--set` adds to the design.
    pub sets: Vec<String>,
    /// The start of the first fault.
    #[serde(with = "super::nanos")]
    pub from: Time,
    /// The end of the last fault; `from` if a fault lasts for good.
    #[serde(with = "super::nanos")]
    pub to: Time,
    /// The time that the filter may be wrong while its health is good \[s\].
    pub recovery: f64,
    /// Whether the design declares that this case fails.
    pub is_known: bool,
    /// The disturbed streams.
    pub(super) streams: Vec<usize>,
}

/// A fault on a stream or on one of its channels, without its time.
#[derive(Clone, Debug)]
struct Single<'a> {
    kind: &'a Kind,
    stream: usize,
    on: String,
    size: String,
    /// The path of the fault table of the stream.
    path: String,
    /// The fields of the fault, without the window.
    fields: String,
}

/// The cases of a design, and the faults that do not fit it.
pub(super) struct Cases {
    pub(super) cases: Vec<Case>,
    pub(super) unfit: Vec<String>,
}

/// A disturbed stream.
pub(super) struct Target<'a> {
    pub(super) stream: usize,
    pub(super) layout: &'a StreamLayout,
    /// The path of its fault table.
    pub(super) path: String,
    pub(super) is_input: bool,
    pub(super) channels: Vec<ProvidedChannel>,
}

impl Case {
    /// The undisturbed run, watched as long as for a fault of half a minute.
    pub(super) fn undisturbed(at: Time) -> Self {
        Self::quiet(at, at.shifted(nanos(30.0)))
    }

    /// No fault from `from` to `to`.
    pub(super) fn quiet(from: Time, to: Time) -> Self {
        Self {
            fault: "none".to_owned(),
            on: String::new(),
            size: String::new(),
            sets: Vec::new(),
            from,
            to,
            recovery: f64::INFINITY,
            is_known: false,
            streams: Vec::new(),
        }
    }
}

/// All cases of `catalogue` for `design`: each fault alone, then the pairs that `seed` draws.
pub(super) fn cases(
    design: &Design,
    assembly: &Assembly,
    catalogue: &Catalogue,
    survey: &Survey,
    at: Time,
    seed: u64,
) -> Result<Cases, Diagnostics> {
    let (mut d, mut singles, mut unfit) = (Diagnostics::new(), Vec::new(), Vec::new());
    let targets = targets(design, assembly);
    for kind in &catalogue.kinds {
        let before = singles.len();
        // A stream that has ended has no row to disturb.
        for target in targets.iter().filter(|t| survey.streams[t.stream].times.last() >= Some(&at)) {
            for channel in channels(kind, target) {
                match single(design, assembly, survey, kind, target, channel, seed) {
                    Ok(found) => singles.extend(found),
                    Err(mistakes) => d.extend(mistakes.iter().cloned()),
                }
            }
        }
        if singles.len() == before {
            unfit.push(kind.name.clone());
        }
    }
    d.unless_errors(())?;
    let mut cases: Vec<Case> = singles.iter().map(|single| case(&[(single, at)], survey)).collect();
    for number in 0..catalogue.pairs {
        cases.extend(pair(&singles, catalogue, survey, at, seed, number));
    }
    Ok(Cases { cases, unfit })
}

/// The streams that the filter reads.
pub(super) fn targets<'a>(design: &Design, assembly: &'a Assembly) -> Vec<Target<'a>> {
    let root = design.document.root();
    let readers = ["process", "sensor", "stage", "initial"].map(|table| root.get(table));
    let is_read = |name: &str| readers.iter().flatten().any(|table| table.any(&|node| node.as_str() == Some(name)));
    let input = root.at("process.source").and_then(Node::as_str);
    let own = design.simulation.as_ref().map_or_else(Vec::new, |s| s.block.world.instruments());
    let mut targets = Vec::new();
    for (stream, layout) in assembly.streams.iter().enumerate() {
        let name = layout.name.as_str();
        let is_reference = name == REFERENCE || design.reference.as_ref().is_some_and(|r| r.block.source.has(name));
        let own = own.iter().find(|(stream, _)| stream_of(design, stream) == name);
        let path = if design.simulation.is_none() {
            format!("source.{name}.fault")
        } else if let Some((_, table)) = own {
            format!("simulation.{table}.fault")
        } else {
            format!("simulation.sensor.{name}.fault")
        };
        let is_source = root.at(path.trim_end_matches(".fault")).is_some();
        let is_simulated = design.simulation.is_some();
        if is_reference || !is_source || !(is_simulated || is_read(name)) {
            continue;
        }
        let provided = |c: &StreamChannel| ProvidedChannel {
            channel: Channel {
                name: c.name.clone().into(),
                width: c.width,
                dimension: c.dimension,
                shape: c.shape,
            },
            offset: c.offset,
            delay_ns: c.delay,
        };
        targets.push(Target {
            stream,
            layout,
            path,
            is_input: input == Some(name) || UNITS.contains(&name),
            channels: layout.channels.iter().map(provided).collect(),
        });
    }
    targets
}

/// The channels that a fault disturbs one by one; `None` is the whole row.
fn channels(kind: &Kind, target: &Target<'_>) -> Vec<Option<usize>> {
    match kind.each {
        Each::Stream => vec![None],
        Each::Channel => (0..target.channels.len()).map(Some).collect(),
    }
}

/// A fault of the catalogue on a channel or a stream; `None` if it does not fit.
fn single<'a>(
    design: &Design,
    assembly: &Assembly,
    survey: &Survey,
    kind: &'a Kind,
    target: &Target<'_>,
    channel: Option<usize>,
    seed: u64,
) -> Result<Option<Single<'a>>, Diagnostics> {
    let name = &target.layout.name;
    let named = channel.map(|c| &target.channels[c]);
    let on = match named {
        Some(c) if target.channels.len() > 1 => format!("{name}.{}", c.channel.name),
        _ => name.clone(),
    };
    let sizes = if target.is_input { &kind.input } else { &kind.size };
    // A fault with a size only for sensors, or only for the input, does not apply to the other.
    if sizes.is_empty() && !(kind.size.is_empty() && kind.input.is_empty()) {
        return Ok(None);
    }
    let mut fields: Vec<String> = kind.fields.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    let mut shown = Vec::new();
    if let Some(c) = named {
        fields.push(format!("channel = {:?}", c.channel.name));
        for (field, multiple) in sizes {
            let scale = scale(design, assembly, survey, target, channel.unwrap_or(0));
            let by = sized(&scale, *multiple, derive_seed(seed, &[&kind.name, &on, field]));
            let total = math::sqrt(by.iter().map(|x| x * x).sum::<f64>());
            shown.push(unit(&c.channel, field).list(&[total]));
            fields.push(format!("{field} = {by:?}"));
        }
    }
    let fields = fields.join(", ");
    if !fits(kind, target, &fields)? {
        return Ok(None);
    }
    Ok(Some(Single {
        kind,
        stream: target.stream,
        on,
        size: shown.join(", "),
        path: target.path.clone(),
        fields,
    }))
}

/// Whether the fault can be built on the stream; a mistake in its fields is a mistake of the catalogue.
fn fits(kind: &Kind, target: &Target<'_>, fields: &str) -> Result<bool, Diagnostics> {
    let mut d = Diagnostics::new();
    let text = format!("fault = {{ {fields}, window = {{ from = 0, to = 1 }} }}");
    let (document, mistakes) = Document::parse(&format!("fault `{}` of the catalogue", kind.name), &text);
    d.extend(mistakes);
    let node = document.root().get("fault").unwrap_or(document.root());
    let spec = node.read_block::<dyn FaultSpec>("fault", &registry::names(Role::Fault), &mut d);
    if d.has_errors() {
        let why = d.iter().next().map_or_else(String::new, |first| first.message.clone());
        let place = kind.node.name_place();
        return Err(Diagnostic::error(format!("fault `{}`: {why}", kind.name)).at(place).into());
    }
    let context = FaultContext {
        channels: &target.channels,
        seed: 0,
    };
    Ok(spec.is_some_and(|spec| spec.build(&context).is_ok()))
}

/// The scale of a channel per axis: the declared 1σ of its sensors, but at least their innovations. Without such a
/// sensor, it follows from the rows of the stream.
pub(super) fn scale(design: &Design, assembly: &Assembly, survey: &Survey, target: &Target<'_>, channel: usize) -> Vec<f64> {
    let c = &target.channels[channel].channel;
    let axes = c.degrees();
    let is_reader = |info: &&fusion::assembly::SensorInfo| {
        let names = [Some(target.layout.name.as_str()), target.layout.alias.as_deref()];
        let reads = info.channels.iter().any(|read| read.name == c.name);
        // A simulated sensor has its own stream, with its name.
        let is_own = design.simulation.is_none() || design.sensors[info.design].name == target.layout.name;
        reads && is_own && names.contains(&Some(info.stream.as_str())) && info.sigma.len() == axes
    };
    let wanted = displacement(c);
    let declared = assembly
        .sensors
        .iter()
        .filter(is_reader)
        .filter(|info| info.rows.iter().all(|r| *r == wanted));
    if let Some(info) = declared.max_by(|a, b| a.sigma.iter().sum::<f64>().total_cmp(&b.sigma.iter().sum())) {
        let seen = survey.innovations.iter().find(|(name, _)| *name == info.name);
        let seen = |axis: usize| seen.and_then(|(_, rms)| rms.get(axis)).copied().unwrap_or(0.0);
        return info.sigma.iter().enumerate().map(|(axis, s)| s.max(seen(axis))).collect();
    }
    let learnt = &survey.streams[target.stream];
    let one = if target.is_input {
        learnt.spread(target.layout, channel)
    } else {
        learnt.change(target.layout, channel)
    };
    vec![one; axes]
}

/// The dimension of a displacement of a channel.
fn displacement(channel: &Channel) -> Dimension {
    match channel.shape {
        Shape::Geodetic => dim::Length::KIND.dimension,
        Shape::Quaternion => dim::Angle::KIND.dimension,
        Shape::Vector | Shape::Angle => channel.dimension,
    }
}

/// The unit of a sized field: the unit of a displacement; for a `rate`, per second.
pub(super) fn unit(channel: &Channel, field: &str) -> Unit {
    let plain = displacement(channel);
    let per_second = || plain.times(dim::Frequency::KIND.dimension);
    let dimension = if field == "rate" { per_second().unwrap_or(plain) } else { plain };
    Unit::of_si(&dimension.to_string())
}

/// `multiple` times the scale, in a direction drawn with `seed`.
pub(super) fn sized(scale: &[f64], multiple: f64, seed: u64) -> Vec<f64> {
    let unit = |k: usize| {
        let drawn = derive_seed(seed, &["axis", &k.to_string()]);
        // 53 bits, from −1 to 1.
        (drawn >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let direction: Vec<f64> = (0..scale.len()).map(unit).collect();
    let length = math::sqrt(direction.iter().map(|x| x * x).sum::<f64>()).max(f64::MIN_POSITIVE);
    let by = direction.iter().zip(scale).map(|(x, s)| digits(multiple * s * x / length));
    by.collect()
}

/// Rounds to four digits: people read the values in a design.
pub(super) fn digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The window of a fault on a stream from `at` on: rows are never at its ends. After the end of a stream, it covers the
/// last row.
fn window(kind: &Kind, times: &[Time], at: Time) -> (Time, Option<Time>) {
    // A microsecond: the resolution of seconds since 1970.
    let between = |i: usize| match (i.checked_sub(1).and_then(|before| times.get(before)), times.get(i)) {
        (Some(a), Some(b)) => a.shifted(b.nanos().saturating_sub(a.nanos()) / 2),
        (_, Some(b)) => b.shifted(-1_000),
        (Some(a), None) => a.shifted(1_000),
        (None, None) => at,
    };
    let first = times.partition_point(|t| *t < at);
    match kind.extent {
        Extent::Rows(rows) => {
            let first = first.min(times.len().saturating_sub(1));
            (between(first), Some(between(first.saturating_add(rows).min(times.len()))))
        }
        Extent::Seconds(seconds) => (at, Some(at.shifted(nanos(seconds)))),
        Extent::ForGood => (at, None),
    }
}

/// A time of the log, in TOML.
pub(super) fn seconds(t: Time) -> String {
    const SECOND: i64 = 1_000_000_000;
    format!("\"{}.{:09} s\"", t.nanos().div_euclid(SECOND), t.nanos().rem_euclid(SECOND))
}

/// The case of one fault or of two, each from its own start.
fn case(parts: &[(&Single<'_>, Time)], survey: &Survey) -> Case {
    let joined = |of: for<'s> fn(&'s Single<'_>) -> &'s str| {
        let all: Vec<&str> = parts.iter().map(|(s, _)| of(s)).filter(|text| !text.is_empty()).collect();
        all.join(" + ")
    };
    let mut windows = Vec::new();
    let mut sets = Vec::new();
    for (number, (single, at)) in parts.iter().enumerate() {
        let (from, to) = window(single.kind, &survey.streams[single.stream].times, *at);
        windows.push((from, to.unwrap_or(from)));
        let end = to.map_or_else(String::new, |to| format!(", to = {}", seconds(to)));
        let Single { path, fields, .. } = single;
        let fault = format!(
            "{path}.stress-{}={{ {fields}, window = {{ from = {}{end} }} }}",
            number + 1,
            seconds(from)
        );
        sets.push(fault);
    }
    Case {
        fault: joined(|s| &s.kind.name),
        on: joined(|s| &s.on),
        size: joined(|s| &s.size),
        sets,
        from: windows.iter().map(|w| w.0).min().unwrap_or_default(),
        to: windows.iter().map(|w| w.1).max().unwrap_or_default(),
        is_known: parts.iter().any(|(s, _)| s.kind.known.contains(&s.on)),
        recovery: parts.iter().map(|(s, _)| s.kind.recovery).fold(0.0, f64::max),
        streams: parts.iter().map(|(s, _)| s.stream).collect(),
    }
}

/// The pair with this number; `None` if there are fewer than two faults.
fn pair(singles: &[Single<'_>], catalogue: &Catalogue, survey: &Survey, at: Time, seed: u64, number: u32) -> Option<Case> {
    let number = number.to_string();
    let draw = |what: &str| derive_seed(seed, &["pair", &number, what]);
    let index = |what: &str, n: usize| usize::try_from(draw(what) % (n.max(1) as u64)).unwrap_or(0);
    let first = index("first", singles.len());
    // Any other fault.
    let step = 1 + index("second", singles.len().saturating_sub(1));
    let second = singles.get((first + step) % singles.len().max(1))?;
    let first = singles.get(first).filter(|_| singles.len() > 1)?;
    let share = (draw("apart") >> 11) as f64 / (1_u64 << 53) as f64;
    Some(case(&[(first, at), (second, at.shifted(nanos(share * catalogue.apart)))], survey))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fusion_models::vocabulary::channel;

    fn kind(extent: Extent) -> Kind {
        Kind {
            name: "fault".to_owned(),
            each: Each::Stream,
            extent,
            size: std::collections::BTreeMap::new(),
            input: std::collections::BTreeMap::new(),
            recovery: 1.0,
            fields: Vec::new(),
            known: Vec::new(),
            node: Document::parse("empty", "").0.root().clone(),
        }
    }

    #[test]
    fn a_window_of_rows_holds_so_many_however_they_are_spaced() {
        let times: Vec<Time> = [0.0, 1.0, 2.5, 2.6, 7.0].map(Time::from_seconds).into();
        for (rows, at, held) in [(1, 1.0, 1..2), (2, 1.2, 2..4), (9, 2.6, 3..5), (1, 9.0, 4..5), (1, -3.0, 0..1)] {
            let (from, to) = window(&kind(Extent::Rows(rows)), &times, Time::from_seconds(at));
            let found: Vec<usize> = (0..5).filter(|i| times[*i] >= from && Some(times[*i]) < to).collect();
            assert_eq!(found, held.collect::<Vec<_>>(), "{rows} from {at}");
        }
        let at = Time::from_seconds(3.0);
        assert_eq!(window(&kind(Extent::ForGood), &times, at), (at, None));
        assert_eq!(window(&kind(Extent::Seconds(2.0)), &times, at), (at, Some(Time::from_seconds(5.0))));
    }

    #[test]
    fn a_size_is_so_many_times_the_scale_in_a_direction_of_unit_length() {
        for seed in 0..20 {
            let by = sized(&[2.0, 2.0, 2.0], 30.0, seed);
            // Each number is written with four digits.
            assert!((by.iter().map(|x| x * x).sum::<f64>().sqrt() - 60.0).abs() < 0.03, "{by:?}");
        }
        assert_ne!(sized(&[1.0; 3], 1.0, 1), sized(&[1.0; 3], 1.0, 2));
        assert_eq!(sized(&[0.5], 4.0, 1)[0].abs(), 2.0);
    }

    #[test]
    fn a_place_is_displaced_in_metres_and_a_ramp_per_second() {
        let shown = |c: &Channel, field: &str| unit(c, field).list(&[2.0]);
        assert_eq!(shown(&channel::POSITION, "value"), "2 m");
        assert_eq!(shown(&channel::VELOCITY, "rate"), "2 m/s²");
        assert_eq!(shown(&channel::ATTITUDE, "value"), "114.6 deg");
    }
}
