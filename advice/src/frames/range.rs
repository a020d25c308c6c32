//! Finds values that are impossible on Earth, and row rates that are too low or too high. They show a wrong unit if no
//! column name and no other channel does.

use super::judge::Judge;
use super::log::Track;
use super::mistake::{check_unit, fitting};
use crate::inspect::median;
use fusion::config::{Diagnostic, Edit, Node};
use fusion_models::units::parse_unit;
use fusion_tables::short;
use nalgebra::Vector3;

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
        let ([least, most], size) = (range.is, size(track));
        let is_within = |size: f64, by: f64| (least / by..most * by).contains(&size);
        let is_beyond = size > 0.0 && !is_within(size, range.beyond);
        if !(is_beyond && self.design.sensors.iter().any(|sensor| is_read(&sensor.node))) {
            return;
        }
        let declared = self.channel(track).and_then(|table| table.get("unit")).and_then(Node::as_str);
        let declared = declared.unwrap_or(range.units[0]).to_owned();
        let unit = fits(range.units, &declared, |factor| is_within(size * factor, 1.2));
        let help = unit.map_or_else(check_unit, |unit| fitting(&declared, unit));
        let shown = parse_unit(&declared).map_or(size, |(unit, _)| size / unit);
        let verdict = format!("a median of {} {declared}: not {}", short(shown), range.words);
        let message = format!("`{}` has {verdict}", self.name(track));
        self.accuse(track, "unit", "unit", message, help);
        self.list(track, range.words, track.times.len(), verdict);
    }

    /// Compares the row rate of an inertial unit with the usual range. Returns true if it is plausible.
    pub(super) fn stamps(&mut self) -> bool {
        let mut sources = Vec::new();
        for track in self.all("angular_rate").into_iter().chain(self.all("specific_force")) {
            if sources.contains(&track.source) || self.is_reference(&track) {
                continue;
            }
            sources.push(track.source);
            let [least, most] = RATES;
            // A rate down to a tenth of the limit may be real. Stamps in milliseconds give a much lower one.
            let Some(rate) = rows(&track).filter(|rate| !(least / 10.0..most).contains(rate)) else {
                continue;
            };
            let named = &self.design.sources[track.source];
            let declared = named.node.at("time.unit").and_then(Node::as_str).unwrap_or("s");
            let Some(unit) = fits(&STAMPS, declared, |factor| (least..most / 2.0).contains(&(rate / factor))) else {
                continue;
            };
            let verdict = format!("a row every {} s", short(1.0 / rate));
            let message = format!("`{}` has {verdict}: no inertial unit has", named.name);
            let place = named.node.at("time").map_or_else(|| named.node.place_of("time"), Node::place);
            let edit = Edit::set(format!("source.{}.time.unit", named.name), format!("{unit:?}"));
            let help = format!("`{declared}` is declared, the stamps fit `{unit}`: {edit}");
            let told = Diagnostic::warning(message).at(place).rule("clock-unit");
            self.found.mistakes.push(told.help(help).edits(vec![edit]));
            self.list(&track, "the rows of an inertial unit", track.times.len(), verdict);
        }
        self.found.mistakes.is_empty()
    }
}

/// The median size.
fn size(track: &Track) -> f64 {
    let length = |v: &[f64; 4]| Vector3::new(v[0], v[1], v[2]).norm();
    if track.integrates {
        let means = track.times.windows(2).filter_map(|t| track.mean(t[0], t[1]));
        median(means.map(|mean| mean.norm()))
    } else {
        median(track.values.iter().map(length))
    }
}

/// Rows per second, from the median interval if rows are far apart.
fn rows(track: &Track) -> Option<f64> {
    let step = median(track.times.windows(2).map(|t| t[1] - t[0]));
    let rate = if step > 1.0 { 1.0 / step } else { track.rate };
    (rate > 0.0).then_some(rate)
}

/// The unit with which a number that was read in the `declared` unit is right.
fn fits(units: &[&'static str], declared: &str, is_right: impl Fn(f64) -> bool) -> Option<&'static str> {
    let size = |unit: &str| parse_unit(unit).ok().map(|(size, _)| size);
    let declared = size(declared)?;
    units
        .iter()
        .copied()
        .find(|unit| size(unit).is_some_and(|other| is_right(other / declared)))
}
