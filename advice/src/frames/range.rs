//! Finds values that are impossible on Earth, and row rates that are too low or too high. They show a wrong unit if no
//! column name and no other channel does.

use super::judge::{Comparison, Judge};
use super::log::Track;
use super::mistake::{Remedy, at, fitting};
use fusion::config::{Diagnostic, Edit, Node};
use fusion_core::math;
use fusion_models::units::parse_unit;
use fusion_tables::short;

/// The range of a channel on Earth.
struct Range {
    channel: &'static str,
    /// The sensor that reads this channel.
    sensor: &'static str,
    /// The limits in SI, and the range in words.
    is: [f64; 2],
    words: &'static str,
    /// A median outside the range by more than this factor is reported.
    beyond: f64,
    units: &'static [&'static str],
}

const RANGES: [Range; 2] = [
    Range {
        channel: "pressure",
        sensor: "barometer",
        is: [3e4, 1.1e5],
        words: "the pressure of the air, 300 to 1100 hPa",
        beyond: 1.5,
        units: &["Pa", "hPa", "kPa", "bar"],
    },
    // Iron and an offset of the instrument may change the field by its own size.
    Range {
        channel: "magnetic_field",
        sensor: "magnetometer",
        is: [2.2e-5, 6.7e-5],
        words: "the field of the Earth, 22 to 67 uT",
        beyond: 6.0,
        units: &["T", "mT", "uT", "nT", "gauss", "mgauss"],
    },
];

/// The range of row rates of inertial units \[1/s\].
const RATES: [f64; 2] = [5.0, 2e4];
/// Units of stamps.
const STAMPS: [&str; 4] = ["s", "ms", "us", "ns"];

impl Judge<'_> {
    /// Compares sensor values with the possible range on Earth.
    pub(super) fn ranges(&mut self) {
        for range in &RANGES {
            for track in self.all(range.channel) {
                self.range(&track, range);
            }
        }
    }

    fn range(&mut self, track: &Track, range: &Range) {
        let source = &self.design.sources[track.source].name;
        let is_read = |node: &Node| {
            let says = |key: &str| node.get(key).and_then(Node::as_str);
            says("type") == Some(range.sensor) && says("source") == Some(source)
        };
        let Some(median) = median(track).filter(|size| *size > 0.0) else {
            return;
        };
        let ([least, most], beyond) = (range.is, range.beyond);
        let is_within = |size: f64, by: f64| (least / by..most * by).contains(&size);
        if !self.design.sensors.iter().any(|sensor| is_read(&sensor.node)) || is_within(median, beyond) {
            return;
        }
        let node = self.node(track);
        let declared = node.at(&format!("channels.{}.unit", track.channel)).and_then(Node::as_str);
        let declared = declared.unwrap_or(range.units[0]);
        let size = |unit: &str| parse_unit(unit).ok().map(|(size, _)| size);
        let is_right = |unit: &&&str| match (size(declared), size(unit)) {
            (Some(is), Some(other)) => is_within(median / is * other, 1.2),
            _ => false,
        };
        let help = match range.units.iter().find(is_right) {
            Some(unit) => fitting(declared, unit),
            None => Remedy::words("check `unit` and `scale`"),
        };
        let shown = size(declared).map_or(median, |size| median / size);
        let verdict = format!("a median of {} {declared}: not {}", short(shown), range.words);
        let message = format!("`{}` has {verdict}", self.name(track));
        let told = help.of(at("unit", node, track.channel, "unit", message), &self.table(track));
        self.told_of(track, range.words, verdict, told);
    }

    /// Compares the row rate of an inertial unit with the usual range. Returns true if it is plausible.
    pub(super) fn stamps(&mut self) -> bool {
        let mut sources = Vec::new();
        for track in self.all("angular_rate").into_iter().chain(self.all("specific_force")) {
            if sources.contains(&track.source) || self.is_reference(&track) {
                continue;
            }
            sources.push(track.source);
            let Some(rate) = rows(&track) else { continue };
            let [least, most] = RATES;
            // A rate down to a tenth of the limit may be real. Stamps in milliseconds give a much lower one.
            if (least / 10.0..most).contains(&rate) {
                continue;
            }
            let named = &self.design.sources[track.source];
            let declared = named.node.at("time.unit").and_then(Node::as_str).unwrap_or("s");
            let size = |unit: &str| parse_unit(unit).ok().map(|(size, _)| size);
            let is_right = |unit: &&str| match (size(declared), size(unit)) {
                (Some(is), Some(other)) => (least..most / 2.0).contains(&(rate * is / other)),
                _ => false,
            };
            let Some(unit) = STAMPS.into_iter().find(is_right) else { continue };
            let verdict = format!("a row every {} s", short(1.0 / rate));
            let message = format!("`{}` has {verdict}: no inertial unit has", named.name);
            let place = named.node.at("time").map_or_else(|| named.node.place_of("time"), Node::place);
            let edit = Edit::set(format!("source.{}.time.unit", named.name), format!("{unit:?}"));
            let help = format!("`{declared}` is declared, the stamps fit `{unit}`: {edit}");
            let told = Diagnostic::warning(message)
                .at(place)
                .rule("clock-unit")
                .help(help)
                .edits(vec![edit]);
            self.told_of(&track, "the rows of an inertial unit", verdict, told);
        }
        self.found.mistakes.is_empty()
    }

    fn told_of(&mut self, track: &Track, with: &str, verdict: String, mistake: Diagnostic) {
        self.found.comparisons.push(Comparison {
            what: self.name(track),
            with: with.to_owned(),
            samples: track.times.len(),
            correlation: Vec::new(),
            margin: 0.0,
            verdict,
        });
        self.found.mistakes.push(mistake);
    }
}

/// The median size.
fn median(track: &Track) -> Option<f64> {
    let length = |v: &[f64]| math::sqrt(v[..3].iter().map(|v| v * v).sum::<f64>());
    let mut sizes: Vec<f64> = if track.integrates {
        let pairs = track.times.windows(2).filter_map(|t| track.mean(t[0], t[1]));
        pairs.map(|mean| mean.norm()).collect()
    } else {
        track.values.iter().map(|v| length(v)).collect()
    };
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() / 2).copied()
}

/// Rows per second, from the median interval if rows are far apart.
fn rows(track: &Track) -> Option<f64> {
    let mut steps: Vec<f64> = track.times.windows(2).map(|t| t[1] - t[0]).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2).copied();
    match middle {
        Some(step) if step > 1.0 => Some(1.0 / step),
        _ => (track.rate > 0.0).then_some(track.rate),
    }
}
