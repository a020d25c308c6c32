//! Streams: the channels of their rows, and the streams that a design declares.

use crate::config::Diagnostics;
use crate::design::Design;
use fusion_models::block::{Channel, Shape};
use fusion_models::fault::ProvidedChannel;
use fusion_models::plausible::{Bounds, Possible};
use fusion_models::units::Dimension;

/// A named group of numbers in the rows of a stream, with its position in the row.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamChannel {
    /// Its name.
    pub name: String,
    /// Its first number in a row.
    pub offset: usize,
    /// How many numbers.
    pub width: usize,
    /// Their dimension, if they have one.
    pub dimension: Dimension,
    /// Their shape, such as a vector or a quaternion.
    pub shape: Shape,
    /// Valid this many nanoseconds before the stamp.
    pub delay: i64,
}

impl StreamChannel {
    /// Returns true if it has the width, shape and dimension that a consumer wants.
    pub(super) fn fits(&self, wanted: &Channel) -> bool {
        self.width == wanted.width
            && self.shape == wanted.shape
            && (self.dimension == wanted.dimension || matches!(wanted.shape, Shape::Geodetic | Shape::Quaternion))
    }
}

/// A stream with its channels.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamLayout {
    /// Its name.
    pub name: String,
    /// The source that its sensor names, if a simulated sensor has its own stream.
    pub alias: Option<String>,
    /// Its channels, in order.
    pub channels: Vec<StreamChannel>,
    /// Whether the channels are known, or taken from what consumers ask for.
    pub declared: bool,
}

impl StreamLayout {
    /// Numbers in a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.channels.iter().map(|c| c.offset + c.width).max().unwrap_or(0)
    }

    /// The possible numbers of its channels.
    #[must_use]
    pub fn bounds(&self) -> Vec<Bounds> {
        let of = |c: &StreamChannel| Bounds {
            first: c.offset,
            width: c.width,
            numbers: Possible::of(&c.name, c.shape, c.dimension),
        };
        self.channels.iter().map(of).collect()
    }

    /// The layout of a source that provides these channels.
    #[must_use]
    pub fn provided(name: &str, channels: &[ProvidedChannel]) -> Self {
        let channels = channels.iter().map(|p| StreamChannel {
            name: p.channel.name.to_string(),
            offset: p.offset,
            width: p.channel.width,
            dimension: p.channel.dimension,
            shape: p.channel.shape,
            delay: p.delay_ns,
        });
        Self {
            name: name.to_owned(),
            alias: None,
            channels: channels.collect(),
            declared: true,
        }
    }

    /// With these channels one after the other.
    #[must_use]
    pub fn of(name: &str, alias: Option<&str>, channels: &[Channel]) -> Self {
        let mut layout = Self {
            alias: alias.map(str::to_owned),
            declared: true,
            ..Self::undeclared(name)
        };
        channels.iter().for_each(|c| layout.append(c));
        layout
    }

    /// With no channels but those that consumers will ask for.
    pub(super) fn undeclared(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            alias: None,
            channels: Vec::new(),
            declared: false,
        }
    }

    pub(super) fn channel(&self, name: &str) -> Option<&StreamChannel> {
        self.channels.iter().find(|c| c.name == name)
    }

    pub(super) fn append(&mut self, channel: &Channel) {
        let offset = self.width();
        self.channels.push(StreamChannel {
            name: channel.name.to_string(),
            offset,
            width: channel.width,
            dimension: channel.dimension,
            shape: channel.shape,
            delay: 0,
        });
    }
}

/// The streams that the sources of a design, or its simulated world, provide.
///
/// # Errors
/// Mistakes in the declaration of a source.
pub fn declared_streams(design: &Design) -> Result<Vec<StreamLayout>, Diagnostics> {
    let mut d = Diagnostics::new();
    let (streams, _) = known_streams(design, &mut d);
    d.unless_errors(streams)
}

/// The streams with correct declarations, and the names of the incomplete streams.
pub(super) fn known_streams<P>(design: &Design<P>, d: &mut Diagnostics) -> (Vec<StreamLayout>, Vec<String>) {
    let mut vague = design.unread.streams.clone();
    let mut streams = Vec::new();
    for named in &design.sources {
        match named.block.source.channels() {
            Ok(channels) => streams.push(StreamLayout::provided(&named.name, &channels)),
            Err(errors) => {
                d.extend(errors.iter().map(|e| named.node.locate(e)));
                vague.push(named.name.clone());
            }
        }
    }
    // A simulated world takes the place of the sources.
    if let Some(simulation) = &design.simulation {
        vague.extend(design.unread.sensors.iter().filter_map(|sensor| {
            let source = design.document.root().get("sensor")?.get(sensor)?.get("source")?;
            source.as_str().map(str::to_owned)
        }));
        return (super::simulated::simulated_streams(design, &simulation.block), vague);
    }
    (streams, vague)
}
