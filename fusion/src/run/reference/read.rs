//! The channels of a source that a run is scored against, and how its rows become epochs.

use crate::assembly::StreamLayout;
use crate::config::{Diagnostic, Diagnostics, Node};
use crate::design::{DifferentiateSpec, Named, ReferenceChannel, ReferencePart, ReferenceSpec, SigmaOf, SourceDesign};
use crate::run::unknown_reference;
use crate::score::ReferenceEpoch;
use core::ops::Range;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::state::{Attitude, Manifold};
use fusion_core::time::Time;
use fusion_models::block::Shape;
use fusion_models::units::{Dimension, Dimensional, dim};
use nalgebra::Vector3;

/// An unknown position.
const NOWHERE: Geodetic = Geodetic::new(f64::NAN, f64::NAN, f64::NAN);

/// The quantity of a channel: position (0), velocity (1) or attitude (2).
const fn quantity(channel: ReferenceChannel) -> usize {
    match channel {
        ReferenceChannel::Velocity => 1,
        ReferenceChannel::Attitude => 2,
        _ => 0,
    }
}

/// The axes of a channel: north, east, down, or the body axes.
const fn axes(channel: ReferenceChannel) -> Range<usize> {
    match channel {
        ReferenceChannel::HorizontalPosition => 0..2,
        ReferenceChannel::Height | ReferenceChannel::Depth => 2..3,
        ReferenceChannel::Position | ReferenceChannel::Velocity | ReferenceChannel::Attitude => 0..3,
    }
}

/// Checks the numbers of a channel; the error describes what is required.
fn is_fit(channel: ReferenceChannel, width: usize, shape: Shape, dimension: Dimension) -> Result<(), &'static str> {
    let length = dimension == dim::Length::KIND.dimension;
    let (fits, wanted) = match channel {
        ReferenceChannel::Position => (shape == Shape::Geodetic, "a position of three numbers"),
        ReferenceChannel::HorizontalPosition => (shape == Shape::Angle && width == 2, "a latitude and a longitude"),
        ReferenceChannel::Height | ReferenceChannel::Depth => (width == 1 && length, "one length"),
        ReferenceChannel::Velocity => (
            width == 3 && shape == Shape::Vector && dimension == dim::Speed::KIND.dimension,
            "a velocity of three numbers",
        ),
        ReferenceChannel::Attitude => (shape == Shape::Quaternion, "an attitude"),
    };
    if fits { Ok(()) } else { Err(wanted) }
}

/// Where the 1σ of a reference's own error comes from.
#[derive(Clone, Copy, Debug)]
enum SigmaFrom {
    /// The design, per axis.
    Declared([f64; 3]),
    /// The numbers of a row from this index on, times a factor.
    Row(usize, f64),
}

/// A channel used for the score.
#[derive(Clone, Debug)]
struct Counted {
    channel: ReferenceChannel,
    /// Its numbers in a row.
    values: Range<usize>,
    delay: i64,
    sigma: SigmaFrom,
}

/// A source that a run is scored against.
#[derive(Clone, Debug)]
pub(in crate::run) struct Scored {
    name: String,
    /// Its declaration; a simulated truth has none.
    node: Option<Node>,
    part: ReferencePart,
    channels: Vec<Counted>,
}

/// The sources of the reference, found and checked by their declared channels.
///
/// # Errors
/// A source that does not exist, a channel that the source does not have, or two sources with one quantity.
pub(in crate::run) fn check(reference: &Named<ReferenceSpec>, sources: &[Named<SourceDesign>]) -> Result<Vec<Scored>, Diagnostics> {
    let mut d = Diagnostics::new();
    let mut all: Vec<Scored> = Vec::new();
    for (name, part) in reference.block.sources() {
        let Some(named) = sources.iter().find(|s| s.name == name) else {
            d.push(unknown_reference(sources, reference, name));
            continue;
        };
        // Mistakes of the source itself are reported with the source.
        let Ok(provided) = named.block.source.channels() else { continue };
        let layout = StreamLayout::provided(name, &provided);
        all.extend(Scored::of(named, &layout, part, reference, &mut d));
    }
    let given: Vec<(&str, ReferenceChannel)> = all
        .iter()
        .flat_map(|s| s.channels.iter().map(|c| (s.name.as_str(), c.channel)))
        .collect();
    for (k, (name, channel)) in given.iter().enumerate() {
        let Some((other, first)) = given[..k].iter().find(|(_, other)| overlap(*other, *channel)) else {
            continue;
        };
        let message = format!(
            "`{}` of `{name}` is scored already, by `{}` of `{other}`",
            channel.name(),
            first.name()
        );
        let place = reference.node.place_of(&reference.block.path(name, "channels"));
        let help = "say which channels of each source count, e.g. `channels = [\"attitude\"]`";
        d.push(Diagnostic::error(message).at(place).help(help));
    }
    d.unless_errors(all)
}

/// Returns true if both give the same quantity in a common axis.
fn overlap(one: ReferenceChannel, two: ReferenceChannel) -> bool {
    let (a, b) = (axes(one), axes(two));
    quantity(one) == quantity(two) && a.start < b.end && b.start < a.end
}

/// The channels used if the design names none: all channels of the source, each quantity once.
fn usual(has: impl Fn(&ReferenceChannel) -> bool) -> Vec<ReferenceChannel> {
    let mut usual: Vec<ReferenceChannel> = Vec::new();
    for channel in ReferenceChannel::ALL.into_iter().filter(has) {
        if !usual.iter().any(|other| overlap(*other, channel)) {
            usual.push(channel);
        }
    }
    usual
}

impl Scored {
    /// A simulated truth, exact and at the body origin.
    pub(super) fn exact(layout: &StreamLayout) -> Self {
        let known = |c: &crate::assembly::StreamChannel| {
            let channel = ReferenceChannel::ALL.into_iter().find(|known| known.name() == c.name)?;
            Some(Counted {
                channel,
                values: c.offset..c.offset + c.width,
                delay: c.delay,
                sigma: SigmaFrom::Declared([0.0; 3]),
            })
        };
        Self {
            name: layout.name.clone(),
            node: None,
            part: ReferencePart::default(),
            channels: layout.channels.iter().filter_map(known).collect(),
        }
    }

    /// A recorded source with these channels; mistakes go to `d`.
    fn of(
        named: &Named<SourceDesign>,
        layout: &StreamLayout,
        part: ReferencePart,
        reference: &Named<ReferenceSpec>,
        d: &mut Diagnostics,
    ) -> Option<Self> {
        let has = |channel: &ReferenceChannel| layout.channels.iter().any(|c| c.name == channel.name());
        let wanted: Vec<ReferenceChannel> = match &part.channels {
            Some(wanted) => wanted.clone(),
            None => usual(has),
        };
        if wanted.is_empty() {
            let message = format!("the reference `{}` has no channel to be scored against", named.name);
            let names: Vec<String> = ReferenceChannel::ALL.iter().map(|c| format!("`{}`", c.name())).collect();
            let help = format!("give it one of {}", names.join(", "));
            d.push(Diagnostic::error(message).at(named.node.name_place()).help(help));
            return None;
        }
        let channels = wanted
            .iter()
            .filter_map(|channel| counted(*channel, layout, &part, reference, d))
            .collect();
        Some(Self {
            name: named.name.clone(),
            node: Some(named.node.clone()),
            part,
            channels,
        })
    }

    /// Its name.
    pub(in crate::run) fn name(&self) -> &str {
        &self.name
    }

    /// Its declaration as a source.
    pub(super) const fn node(&self) -> Option<&Node> {
        self.node.as_ref()
    }

    /// Its point in body axes \[m\].
    pub(super) fn point(&self) -> Vector3<f64> {
        self.part.lever_arm.si().into()
    }

    /// How a missing velocity is derived.
    pub(super) const fn slope(&self) -> Option<&DifferentiateSpec> {
        self.part.velocity_from_position.as_ref()
    }

    /// The reference epochs of a row: one for each time at which some of its channels are valid. A
    /// channel has no value if one of its numbers or its 1σ is not finite.
    pub(super) fn epochs(&self, time: Time, row: &[f64]) -> Vec<ReferenceEpoch> {
        let mut epochs: Vec<ReferenceEpoch> = Vec::with_capacity(1);
        for counted in &self.channels {
            let values = &row[counted.values.clone()];
            let sigma = counted.sigma(row);
            if !values.iter().chain(&sigma).all(|v| v.is_finite()) {
                continue;
            }
            let valid = time.shifted(-counted.delay);
            let at = epochs.iter().position(|e| e.time == valid).unwrap_or_else(|| {
                epochs.push(ReferenceEpoch {
                    time: valid,
                    ..ReferenceEpoch::default()
                });
                epochs.len() - 1
            });
            counted.write(values, &sigma, self.surface(), &mut epochs[at]);
        }
        epochs
    }

    fn surface(&self) -> f64 {
        self.part.surface.map_or(0.0, |surface| surface.si())
    }
}

impl Counted {
    /// 1σ of the three axes; 0 for axes that the channel does not have.
    fn sigma(&self, row: &[f64]) -> Vector3<f64> {
        let mut sigma = Vector3::zeros();
        for (k, axis) in axes(self.channel).enumerate() {
            sigma[axis] = match self.sigma {
                SigmaFrom::Declared(declared) => declared[axis],
                SigmaFrom::Row(at, scale) => row[at + k] * scale,
            };
        }
        sigma
    }

    /// Writes its numbers and their 1σ into an epoch; `surface` is the height of the water \[m\].
    fn write(&self, values: &[f64], sigma: &Vector3<f64>, surface: f64, epoch: &mut ReferenceEpoch) {
        let of = &mut epoch.sigma;
        let all = [&mut of.position, &mut of.velocity, &mut of.attitude];
        let [position, velocity, attitude] = all;
        let written = [position, velocity, attitude].into_iter().nth(quantity(self.channel));
        if let Some(written) = written {
            axes(self.channel).for_each(|axis| written[axis] = sigma[axis]);
        }
        match self.channel {
            ReferenceChannel::Position => epoch.position = Some(Geodetic::read(values)),
            ReferenceChannel::HorizontalPosition => {
                let place = epoch.position.get_or_insert(NOWHERE);
                (place.lat, place.lon) = (values[0], values[1]);
            }
            ReferenceChannel::Height => epoch.position.get_or_insert(NOWHERE).height = values[0],
            ReferenceChannel::Depth => epoch.position.get_or_insert(NOWHERE).height = surface - values[0],
            ReferenceChannel::Velocity => epoch.velocity = Some(Vector3::new(values[0], values[1], values[2])),
            ReferenceChannel::Attitude => epoch.attitude = Some(Attitude::read(values)),
        }
    }
}

/// A channel of `layout` used for the score, with its 1σ; mistakes go to `d`.
fn counted(
    channel: ReferenceChannel,
    layout: &StreamLayout,
    part: &ReferencePart,
    reference: &Named<ReferenceSpec>,
    d: &mut Diagnostics,
) -> Option<Counted> {
    let place = |field: &str| reference.node.place_of(&reference.block.path(&layout.name, field));
    let Some(found) = layout.channels.iter().find(|c| c.name == channel.name()) else {
        let known: Vec<&str> = layout.channels.iter().map(|c| c.name.as_str()).collect();
        let message = format!("the reference `{}` has no channel `{}`", layout.name, channel.name());
        d.push(
            Diagnostic::error(message)
                .at(place("channels"))
                .suggest(channel.name(), &known, "it has"),
        );
        return None;
    };
    if let Err(wanted) = is_fit(channel, found.width, found.shape, found.dimension) {
        let message = format!(
            "the channel `{}` of the reference `{}` is not {wanted}",
            channel.name(),
            layout.name
        );
        d.push(Diagnostic::error(message).at(place("source")));
        return None;
    }
    let sigma = match part.sigma.each()[quantity(channel)] {
        None => SigmaFrom::Declared([0.0; 3]),
        Some(SigmaOf::Declared(sigma)) => SigmaFrom::Declared(sigma),
        Some(SigmaOf::Source { scale }) => {
            let reported = reported(channel, layout);
            if reported.is_none() {
                let quantity = ["position", "velocity", "attitude"][quantity(channel)];
                let missing = missing_sigma(channel, &layout.name);
                d.push(missing.at(place(&format!("sigma.{quantity}"))));
            }
            SigmaFrom::Row(reported?, scale)
        }
    };
    Some(Counted {
        channel,
        values: found.offset..found.offset + found.width,
        delay: found.delay,
        sigma,
    })
}

/// The dimension of the 1σ of a channel.
fn dimension(channel: ReferenceChannel) -> Dimension {
    [dim::Length::KIND, dim::Speed::KIND, dim::Angle::KIND][quantity(channel)].dimension
}

/// The index in a row where the 1σ values that the source reports for a channel begin.
fn reported(channel: ReferenceChannel, layout: &StreamLayout) -> Option<usize> {
    let wanted = format!("{}_sigma", channel.name());
    let found = layout.channels.iter().find(|c| c.name == wanted)?;
    (found.width == axes(channel).len() && found.dimension == dimension(channel)).then_some(found.offset)
}

fn missing_sigma(channel: ReferenceChannel, source: &str) -> Diagnostic {
    let wanted = format!("{}_sigma", channel.name());
    let numbers = ["one number", "two numbers", "three numbers"][axes(channel).len() - 1];
    let message = format!(
        "the reference `{source}` has no channel `{wanted}` of {numbers} in {}",
        dimension(channel)
    );
    let help = format!("add `{wanted} = {{ columns = […], unit = … }}` under [source.{source}.channels]");
    Diagnostic::error(message).help(help)
}
