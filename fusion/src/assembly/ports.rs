//! Ports: which columns of which stream a block reads.

use super::StreamLayout;
use super::assemble::Assembler;
use super::streams::StreamChannel;
use crate::config::{Diagnostic, Node, Place};
use fusion_core::runner::{InputLimits, Port, StreamId};
use fusion_models::block::{Channel, Listen, Shape};
use fusion_models::units::{Dimension, Dimensional, dim, range};
use fusion_models::vocabulary::channel;

impl<P> Assembler<'_, P> {
    pub(super) fn position(&self, stream: &str) -> StreamId {
        self.streams.iter().position(|s| s.name == stream).unwrap_or(usize::MAX)
    }

    /// The port of the process; none for a process driven by time alone.
    pub(super) fn input_port(&mut self) -> Option<Port> {
        let process = self.process?;
        let channels = process.block.model.input();
        match (&process.block.source, channels.is_empty()) {
            (Some(source), false) => {
                let port = self.port(source, &channels, &process.node);
                self.check_latencies(port.as_ref(), &channels, &process.node);
                port
            }
            (None, true) => None,
            (None, false) => {
                let names = channels.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(" and ");
                let message = format!("this process is driven by {names} and has no `source`");
                let help = "add `source = \"NAME\"`: the source or stage with these channels";
                self.d.push(Diagnostic::error(message).at(process.node.name_place()).help(help));
                None
            }
            (Some(_), true) => {
                let message = "this process is driven by time alone and reads no source";
                let place = process.node.place_of("source");
                self.d.push(Diagnostic::error(message).at(place).help("remove `source`"));
                None
            }
        }
    }

    /// The limits of the samples of the process input.
    pub(super) fn input_limits(&mut self) -> InputLimits {
        let Some(process) = self.process else {
            return InputLimits::default();
        };
        let (spec, channels) = (&process.block.input, process.block.model.input());
        if channels.is_empty() && process.node.get("input").is_some() {
            let message = "this process is driven by time alone and has no input";
            let place = process.node.place_of("input");
            self.d.push(Diagnostic::error(message).at(place).help("remove `input`"));
        }
        let names: Vec<&str> = channels.iter().map(|c| c.name.as_ref()).collect();
        for name in spec
            .range
            .keys()
            .filter(|name| !channels.is_empty() && !names.contains(&name.as_str()))
        {
            let place = process.node.place_of(&format!("input.range.{name}"));
            let unknown = Diagnostic::error(format!("this process is not driven by `{name}`")).at(place);
            self.d.push(unknown.suggest(name, &names, "its channels are"));
        }
        let mut range = Vec::new();
        for channel in &channels {
            let dimensions = vec![channel.dimension; channel.width];
            let declared = spec.range.get(channel.name.as_ref());
            let limits = declared.map(|limits| limits.si::<range::Positive>(&dimensions));
            match limits {
                Some(Ok(limits)) => range.extend(limits),
                None => range.extend(dimensions.iter().map(|_| f64::INFINITY)),
                Some(Err(why)) => {
                    let place = process.node.place_of(&why.path(&format!("input.range.{}", channel.name)));
                    self.d.push(Diagnostic::error(why.to_string()).at(place));
                }
            }
        }
        let default = InputLimits::default();
        InputLimits {
            range,
            longest_interval: spec.longest_interval.map(|t| t.si()),
            longest_gap: spec.longest_gap.map_or(default.longest_gap, |t| t.si()),
        }
    }

    pub(super) fn listen(&mut self, node: &Node, inputs: &[Listen]) -> Option<Vec<Port>> {
        inputs.iter().map(|l| self.port(&l.source, &l.channels, node)).collect()
    }

    /// Columns of `channels` in the stream, one after the other, and the largest of their delays.
    pub(super) fn port(&mut self, name: &str, channels: &[Channel], node: &Node) -> Option<Port> {
        let stream = self.stream(name, channels, node)?;
        let mut port = Port {
            stream,
            columns: Vec::new(),
            delay: 0,
        };
        for wanted in channels {
            let found = self.channel(stream, wanted, node)?;
            port.columns.extend(found.offset..found.offset + wanted.width);
            port.delay = port.delay.max(found.delay);
        }
        Some(port)
    }

    /// Checks that the channels a block reads from one row have the same latency. The block needs them valid at one
    /// instant: of different latencies, only the largest would have an effect.
    pub(super) fn check_latencies(&mut self, port: Option<&Port>, channels: &[Channel], node: &Node) {
        let Some(port) = port else { return };
        let layout = &self.streams[port.stream];
        let delays: Vec<_> = channels
            .iter()
            .filter_map(|c| Some((&c.name, layout.channel(&c.name)?.delay)))
            .collect();
        let Some((first, of_first)) = delays.first() else { return };
        let Some((other, of_other)) = delays.iter().find(|(_, delay)| delay != of_first) else {
            return;
        };
        let seconds = |delay: i64| delay as f64 * 1e-9;
        let message = format!(
            "this block needs `{first}` and `{other}` of the same instant, but their latencies are {} s and {} s",
            seconds(*of_first),
            seconds(*of_other)
        );
        let help = format!("write the same `latency` for both under [source.{}.channels]", layout.name);
        self.d.push(Diagnostic::error(message).at(node.place_of("source")).help(help));
    }

    /// The stream called `name`. An undeclared stream is created only if the design has no sources at all:
    /// a program feeds such a filter.
    fn stream(&mut self, name: &str, channels: &[Channel], node: &Node) -> Option<StreamId> {
        let serves = |s: &StreamLayout| channels.iter().all(|c| s.channel(&c.name).is_some());
        let is_alias = |s: &StreamLayout| s.alias.as_deref() == Some(name);
        let find = |is: &dyn Fn(&StreamLayout) -> bool| self.streams.iter().position(is);
        let found = find(&|s| (s.name == name || is_alias(s)) && serves(s))
            .or_else(|| find(&|s| s.name == name))
            .or_else(|| find(&is_alias));
        if found.is_some() {
            return found;
        }
        if self.data.is_unread || self.vague.iter().any(|v| v == name) {
            return None;
        }
        if self.data.sources.is_empty() && !self.data.is_simulated {
            self.streams.push(StreamLayout::undeclared(name));
            return Some(self.streams.len() - 1);
        }
        let mut names: Vec<&str> = self.streams.iter().map(|s| s.alias.as_deref().unwrap_or(&s.name)).collect();
        names.sort_unstable();
        names.dedup();
        let unknown = Diagnostic::error(format!("no source or stage is called `{name}`")).at(naming(node, &[name]));
        let mut unknown = unknown.suggest(name, &names, "there are");
        if self.data.is_simulated {
            unknown = unknown.and_help("a simulated sensor, [simulation.sensor.NAME], provides what [sensor.NAME] reads");
        }
        self.d.push(unknown);
        None
    }

    /// A channel of the stream. A stream without declared channels takes `wanted` as a new channel.
    pub(super) fn channel(&mut self, stream: StreamId, wanted: &Channel, node: &Node) -> Option<StreamChannel> {
        let layout = &mut self.streams[stream];
        let is_vague = |layout: &StreamLayout| {
            let is_layout = |name: &String| *name == layout.name || Some(name) == layout.alias.as_ref();
            self.data.is_unread || self.vague.iter().any(is_layout)
        };
        let wrong = match layout.channel(&wanted.name) {
            Some(found) if found.fits(wanted) => return Some(found.clone()),
            Some(found) => mismatch(layout, found, wanted),
            None if !layout.declared => {
                layout.append(wanted);
                return layout.channels.last().cloned();
            }
            None if is_vague(layout) => return None,
            None => missing(layout, wanted),
        };
        let help = match (layout.channel(&wanted.name), self.data.is_simulated) {
            (Some(found), _) if self.data.sources.iter().any(|s| s.name == layout.name) => {
                let table = format!("[source.{}.channels.{}]", layout.name, wanted.name);
                let look = format!("look at the columns and the `unit` under {table}");
                let is_rate = |rate: Dimension, of: Dimension| of.times(dim::Frequency::KIND.dimension) == Some(rate);
                Some(if wanted.width == 3 && found.width == 2 && wanted.name == channel::VELOCITY.name {
                    format!(
                        "without a vertical velocity call the channel `{0}`, which the sensor of type `{0}` reads; else name the third \
                         column under {table}",
                        channel::HORIZONTAL_VELOCITY.name
                    )
                } else if is_rate(wanted.dimension, found.dimension) {
                    format!("write `increment = true` if each row holds the change since the one before; else {look}")
                } else if is_rate(found.dimension, wanted.dimension) {
                    format!("leave out `increment` if each row holds a rate; else {look}")
                } else {
                    look
                })
            }
            (Some(_), _) => None,
            (None, true) => Some(format!(
                "a simulated stream has only the channels that its sensor reads; {}",
                has(layout)
            )),
            (None, false) => Some(format!("declare it under [source.{}.channels]; {}", layout.name, has(layout))),
        };
        let declared = self.data.sources.iter().find(|s| s.name == layout.name);
        let declared = declared.and_then(|s| s.node.get("channels")?.get(&wanted.name));
        let wrong = wrong.at(declared.map_or_else(
            || naming(node, &[&layout.name, layout.alias.as_deref().unwrap_or_default()]),
            |channel| misfit(channel, wanted, layout),
        ));
        self.d.push(match help {
            Some(help) => wrong.help(help),
            None => wrong,
        });
        None
    }
}

/// Where a block names a stream: most do so by `source`, at any depth.
fn naming<'n>(node: &'n Node, stream: &[&str]) -> &'n Place {
    fn find<'n>(node: &'n Node, stream: &[&str]) -> Option<&'n Place> {
        let names = |node: &&Node| node.as_str().is_some_and(|text| stream.contains(&text));
        let fields = || node.entries().iter().filter(|e| e.key != "type").map(|e| &e.node);
        let own = node.get("source").filter(names).or_else(|| fields().find(names));
        own.map(Node::place).or_else(|| fields().find_map(|field| find(field, stream)))
    }
    find(node, stream).unwrap_or_else(|| node.place_of("source"))
}

/// The part of a channel's declaration that does not fit: its columns, or their unit.
fn misfit<'n>(channel: &'n Node, wanted: &Channel, layout: &StreamLayout) -> &'n Place {
    let has_width = layout.channel(&wanted.name).is_some_and(|found| found.width == wanted.width);
    let key = if has_width { "unit" } else { "columns" };
    channel.get(key).unwrap_or(channel).place()
}

fn mismatch(layout: &StreamLayout, found: &StreamChannel, wanted: &Channel) -> Diagnostic {
    Diagnostic::error(format!(
        "channel `{}` of `{}` is {}, and this block reads {}",
        wanted.name,
        layout.name,
        describe(found.width, found.shape, found.dimension),
        describe(wanted.width, wanted.shape, wanted.dimension)
    ))
}

fn missing(layout: &StreamLayout, wanted: &Channel) -> Diagnostic {
    Diagnostic::error(format!(
        "`{}` has no channel `{}`, which this block reads",
        layout.name, wanted.name
    ))
}

fn has(layout: &StreamLayout) -> String {
    let names: Vec<String> = layout.channels.iter().map(|c| format!("`{}`", c.name)).collect();
    match &names[..] {
        [] => "it has no channels".to_owned(),
        _ => format!("it has: {}", names.join(", ")),
    }
}

fn describe(width: usize, shape: Shape, dimension: Dimension) -> String {
    match shape {
        Shape::Geodetic => "a geodetic position".to_owned(),
        Shape::Quaternion => "a quaternion".to_owned(),
        Shape::Vector | Shape::Angle => match width {
            1 => format!("one number, {}", dimension.kind()),
            _ => format!("{width} numbers, each {}", dimension.kind()),
        },
    }
}
