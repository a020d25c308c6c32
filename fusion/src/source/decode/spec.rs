//! The TOML declaration of rows, for all formats.

use super::instant::{Order, Origin, Scale};
use super::one_or_many::OneOrMany;
use crate::config::{Diagnostics, Node};
use crate::source::OwnClock;
use core::fmt;
use core::num::NonZeroU64;
use fusion_models::units::{Duration, PerAxis, Positive, Vec3Of, dim};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, Error, MapAccess, Visitor};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Declares the table of a format: its own keys, then the keys common to all formats. The common keys are
/// read as one [`RowSpec`]. A format also declares its own `time`, such as [`TimeSpec`], whose `stamp` gives
/// the place of the stamp in a row.
#[macro_export]
macro_rules! format_spec {
    ($(#[$about:meta])* pub struct $Name:ident { $($own:tt)* }) => {
        $(#[$about])*
        #[derive(Debug, $crate::models::de::DeserializeSpec, schemars::JsonSchema)]
        #[spec(models = $crate::models)]
        #[serde(deny_unknown_fields)]
        pub struct $Name {
            $($own)*
            /// Nominal rate: the interval that increments cover in the first row and after a gap.
            rate: Option<$crate::models::units::Positive<$crate::models::units::dim::Frequency>>,
            /// Whether increments cover the interval between the stamps, or the nominal one of a unit
            /// that samples evenly and is stamped unevenly.
            #[serde(default)]
            interval: $crate::source::decode::Interval,
            /// The action for a row that cannot be read: `stop`, or `skip` it and report.
            #[serde(default)]
            bad_rows: $crate::source::decode::Policy,
            /// Whether rows that repeat all values of the one before are kept.
            #[serde(default)]
            repeats: $crate::source::decode::Repeats,
            /// Conditions that a row has to meet: one table, or an array of them.
            #[serde(default)]
            valid: $crate::source::decode::OneOrMany<$crate::source::decode::Condition>,
            /// Which rows are kept, counted by their number in the file.
            keep: Option<$crate::source::decode::Keep>,
            /// The channels by name.
            #[serde(default)]
            channels: std::collections::BTreeMap<String, $crate::source::decode::ChannelSpec>,
        }

        impl $Name {
            /// The declaration of the rows.
            fn rows(&self) -> $crate::source::decode::RowSpec<'_> {
                $crate::source::decode::RowSpec {
                    stamp: self.time.stamp(),
                    timing: self.time.timing(),
                    rate: self.rate,
                    interval: self.interval,
                    bad_rows: self.bad_rows,
                    repeats: self.repeats,
                    valid: &self.valid,
                    keep: self.keep,
                    channels: &self.channels,
                }
            }
        }
    };
}

/// The declaration of rows, for all formats.
#[derive(Clone, Debug)]
pub struct RowSpec<'a> {
    /// The place of the stamp.
    pub stamp: Stamp<'a>,
    /// The clock.
    pub timing: Timing<'a>,
    /// The nominal rate.
    pub rate: Option<Positive<dim::Frequency>>,
    /// The interval that increments cover.
    pub interval: Interval,
    /// The action for a row that cannot be read.
    pub bad_rows: Policy,
    /// Whether repeated rows are kept.
    pub repeats: Repeats,
    /// The conditions that a row has to meet.
    pub valid: &'a OneOrMany<Condition>,
    /// Which rows are kept.
    pub keep: Option<Keep>,
    /// The channels by name.
    pub channels: &'a BTreeMap<String, ChannelSpec>,
}

/// Declares the table of a stamp: its place in a row, then the keys common to all formats, which are read as
/// one [`Timing`].
macro_rules! time_spec {
    ($(#[$about:meta])* pub struct $Name:ident { $($own:tt)* }) => {
        $(#[$about])*
        #[derive(Debug, Default, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $Name {
            $($own)*
            /// The stamp at time zero of the log: a number in the unit of the column, as exact as written. With
            /// `counts_from` or `calendar`, a date and time, such as `"2025-07-08T19:34:18Z"`; without `epoch`,
            /// time zero of these logs is the start of GPS time, 1980-01-06.
            epoch: Option<$crate::source::decode::Epoch>,
            /// Seconds of true time per second of this clock; 1 by default.
            scale: Option<f64>,
            /// The time of the log at which the scaled clock is correct; by default its first stamp.
            about: Option<fusion_models::units::Duration>,
            /// Added to every stamp.
            #[serde(default)]
            offset: fusion_models::units::Duration,
            /// Rows before this time of the log are left out.
            start: Option<fusion_models::units::Duration>,
            /// The first row at or after this time of the log ends the source.
            stop: Option<fusion_models::units::Duration>,
            /// Limit of a jump ahead. A stamp later than the previous stamp by more than this is wrong if one of the
            /// next 20 rows goes back: the row is left out and reported. By default ten times the longest recent
            /// interval.
            max_jump: Option<fusion_models::units::Positive<fusion_models::units::dim::Duration>>,
            /// The action for a stamp earlier than the previous stamp: `stop`, or `skip` the row.
            #[serde(default)]
            backwards: $crate::source::decode::Policy,
            /// The action for a stamp equal to the previous stamp: `stop`, `skip` the row or `keep` it.
            #[serde(default)]
            ties: $crate::source::decode::Ties,
        }

        impl $Name {
            /// The declaration of the clock.
            pub const fn timing(&self) -> $crate::source::decode::Timing<'_> {
                $crate::source::decode::Timing {
                    epoch: self.epoch.as_ref(),
                    scale: match self.scale {
                        Some(scale) => scale,
                        None => 1.0,
                    },
                    about: self.about,
                    offset: self.offset,
                    start: self.start,
                    stop: self.stop,
                    max_jump: self.max_jump,
                    backwards: self.backwards,
                    ties: self.ties,
                }
            }
        }
    };
}
pub(in super::super) use time_spec;

/// The declaration of a clock, for all formats.
#[derive(Clone, Copy, Debug)]
pub struct Timing<'a> {
    pub(in super::super) epoch: Option<&'a Epoch>,
    pub(in super::super) scale: f64,
    pub(in super::super) about: Option<Duration>,
    pub(in super::super) offset: Duration,
    pub(in super::super) start: Option<Duration>,
    pub(in super::super) stop: Option<Duration>,
    pub(in super::super) max_jump: Option<Positive<dim::Duration>>,
    pub(in super::super) backwards: Policy,
    pub(in super::super) ties: Ties,
}

time_spec! {
    /// The stamp of a row: log time = about + scale · (stamp − epoch − about) + offset. A stamp in two columns is
    /// their sum.
    pub struct TimeSpec {
        /// Its column. A file without stamps has a `rate` instead.
        column: Option<String>,
        /// The rate of a recording without stamps; its first row is at time zero. With `column`: the rate of its
        /// counter of samples, which is zero at time zero.
        rate: Option<Positive<dim::Frequency>>,
        /// Its unit; decimal stamps of any length are read to the nanosecond. Without `unit`, the unit in brackets at
        /// the end of the column's name, as in `t [ms]`, or seconds.
        unit: Option<String>,
        /// The zero point of the stamps, if the design has sources with other clocks: all are converted to GPS
        /// time, which has no leap seconds.
        counts_from: Option<Origin>,
        /// The column holds calendar dates with the time of day, year first, such as
        /// `2025-07-08T19:34:18.25Z` or `2025/07/08 19:34:18`: in UTC (with `Z`, an offset such as `+02:00`, or
        /// neither), GPS time or TAI.
        calendar: Option<Scale>,
        /// The column of the date, if `column` has only the time of day: `19:34:18.25`, or `193418.25` as NMEA
        /// writes it.
        date: Option<String>,
        /// The date of the first row, such as `"2025-07-08"`, if the file has times of day and no date. After
        /// midnight the next day begins; gaps must be shorter than half a day.
        day: Option<String>,
        /// The order of day, month and year, if the year is not first: `dmy` for `08/07/2025`, `08.07.25` or
        /// `080725`, as NMEA writes it, `mdy` for `07/08/2025`. Years of two digits are 1980 to 2079.
        order: Option<Order>,
        /// A second column, whose time is added: nanoseconds to seconds, weeks to seconds of the week, or the number of
        /// a recording to a clock that begins at zero.
        plus: Option<PlusSpec>,
    }
}

impl TimeSpec {
    /// The declared format of its cells.
    #[must_use]
    pub fn stamp(&self) -> Stamp<'_> {
        let date = self.date.as_ref().map(|column| ("time.date", column.as_str()));
        let plus = self.plus.as_ref().map(|plus| ("time.plus.column", plus.column.as_str()));
        let own = self.column.as_ref().map(|column| ("time.column", column.as_str()));
        Stamp {
            columns: date.into_iter().chain(own).chain(plus).collect(),
            unit: self.unit.as_deref(),
            counts_from: self.counts_from,
            calendar: self.calendar,
            each: self.plus.as_ref().map(|plus| plus.each.si()),
            rate: self.rate.map(|rate| rate.si()),
            day: self.day.as_deref(),
            order: self.order,
        }
    }
}

time_spec! {
    /// The clock of a format that defines the unit and the zero point of its stamps.
    pub struct OwnTimeSpec {
        /// The column of the stamps, if not the usual column of the format.
        column: Option<String>,
    }
}

impl OwnTimeSpec {
    /// The declared column. [`RowSpec::of_own_clock`] adds what the format defines.
    #[must_use]
    pub fn stamp(&self) -> Stamp<'_> {
        let own = self.column.as_ref().map(|column| ("time.column", column.as_str()));
        Stamp {
            columns: own.into_iter().collect(),
            ..Stamp::default()
        }
    }
}

impl<'a> RowSpec<'a> {
    /// The declaration with the stamps of a format that defines their meaning. `usual` is the column that has them
    /// unless another one is declared.
    #[must_use]
    pub fn of_own_clock(mut self, usual: &'a str, clock: OwnClock) -> Self {
        if self.stamp.columns.is_empty() {
            self.stamp.columns.push(("time", usual));
        }
        (self.stamp.unit, self.stamp.counts_from) = (Some(clock.unit), clock.counts_from);
        self
    }
}

/// The place and format of the stamp of a row.
#[derive(Clone, Debug, Default)]
pub struct Stamp<'a> {
    /// Its columns in the order in which they are read, each with its field; for a calendar the date first. Empty
    /// if rows are counted.
    pub(in super::super) columns: Vec<(&'static str, &'a str)>,
    pub(in super::super) unit: Option<&'a str>,
    pub(in super::super) counts_from: Option<Origin>,
    pub(in super::super) calendar: Option<Scale>,
    /// Seconds per count of the second column.
    pub(in super::super) each: Option<f64>,
    /// Rows, or counts of the column, per second.
    pub(in super::super) rate: Option<f64>,
    /// The date of the first row, for times of day.
    pub(in super::super) day: Option<&'a str>,
    pub(in super::super) order: Option<Order>,
}

/// The second column of a stamp.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlusSpec {
    /// The column.
    pub(super) column: String,
    /// The time per count, such as `"1 ns"` or `"7 day"`.
    pub(super) each: Positive<dim::Duration>,
}

/// A number kept as it was written, so that no digit is lost.
#[derive(Clone, Debug)]
pub struct Epoch(pub(super) String);

impl<'de> Deserialize<'de> for Epoch {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Written;

        impl Visitor<'_> for Written {
            type Value = Epoch;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number in the unit of the time column, e.g. 1520530308000000000 or \"1752003258.25\", or a date and time")
            }

            fn visit_i64<E: Error>(self, v: i64) -> Result<Epoch, E> {
                Ok(Epoch(v.to_string()))
            }

            fn visit_u64<E: Error>(self, v: u64) -> Result<Epoch, E> {
                Ok(Epoch(v.to_string()))
            }

            fn visit_f64<E: Error>(self, v: f64) -> Result<Epoch, E> {
                Ok(Epoch(v.to_string()))
            }

            fn visit_str<E: Error>(self, v: &str) -> Result<Epoch, E> {
                Ok(Epoch(v.to_owned()))
            }
        }

        deserializer.deserialize_any(Written)
    }
}

impl JsonSchema for Epoch {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Epoch".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["number", "string"] })
    }
}

/// The action for a wrong row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// End with an error that points at the row.
    #[default]
    Stop,
    /// Leave the row out and report it.
    Skip,
}

/// The interval that an increment covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interval {
    /// The interval since the previous stamp.
    #[default]
    Stamps,
    /// 1/`rate`: the stamps jitter, the samples do not.
    Nominal,
}

/// The action for equal stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Ties {
    /// End with an error that points at the row.
    #[default]
    Stop,
    /// Leave the later row out and report it.
    Skip,
    /// Keep both.
    Keep,
}

/// The action for repeated values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Repeats {
    /// Keep them.
    #[default]
    Keep,
    /// Leave out a row with the same values as the row before.
    Drop,
}

/// Which rows are kept: every n-th row, or all others.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Keep {
    /// Keeps rows number `offset`, `offset + every`, ….
    pub(super) every: Option<NonZeroU64>,
    /// Keeps all rows except those that `every` with this number would keep.
    pub(super) except_every: Option<NonZeroU64>,
    /// Number of the first such row, from 0.
    #[serde(default)]
    pub(super) offset: u64,
}

impl Keep {
    /// Whether row `number`, from 0, is kept.
    pub(super) fn keeps(self, number: u64) -> bool {
        let is_nth = |every: NonZeroU64, offset: u64| number >= offset && (number - offset).is_multiple_of(every.get());
        match (self.every, self.except_every) {
            (Some(every), _) => is_nth(every, self.offset),
            (None, Some(every)) => !is_nth(every, self.offset),
            (None, None) => true,
        }
    }
}

/// Returns true if two source tables of the same file keep rows in common: `keep`, `time.start` and `time.stop` may
/// divide the rows. The meaning of `valid` differs from file to file: with different `valid` conditions, the tables count
/// as having no common rows.
pub(crate) fn have_rows_in_common(one: &Node, other: &Node) -> bool {
    let written = |node: &Node, key: &str| node.get(key).map(Node::inline);
    let keep = |node: &Node| node.get("keep").and_then(|keep| keep.read::<Keep>(&mut Diagnostics::new()));
    if written(one, "valid") != written(other, "valid") {
        return false;
    }
    let end = |node: &Node, key: &str, otherwise: f64| {
        let given = node.at(key).and_then(|end| end.read::<Duration>(&mut Diagnostics::new()));
        given.map_or(otherwise, |end| end.si())
    };
    let (from, to) = (|n| end(n, "time.start", f64::NEG_INFINITY), |n| end(n, "time.stop", f64::INFINITY));
    if to(one) <= from(other) || to(other) <= from(one) {
        return false;
    }
    let keeps = [one, other].map(keep);
    let every = |keep: Keep| keep.every.or(keep.except_every).map_or(1, NonZeroU64::get);
    // The pattern of both repeats after this number of rows; 1e6 rows are a whole log.
    let each = keeps.map(|keep| keep.map_or((1, 0), |keep| (every(keep), keep.offset)));
    let period = each
        .iter()
        .fold(1, |all: u64, (every, _)| all.saturating_mul(*every))
        .min(1_000_000);
    let from = each.iter().map(|(_, offset)| *offset).max().unwrap_or(0);
    let mut rows = from..from.saturating_add(period);
    rows.any(|row| keeps.iter().flatten().all(|keep| keep.keeps(row)))
}

/// A condition on a column.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The column.
    pub(super) column: String,
    /// The required value, a number or text; any value of an array.
    pub(super) equals: Option<OneOrMany<Wanted>>,
    /// The value to exclude, a number or text; all values of an array.
    pub(super) not_equals: Option<OneOrMany<Wanted>>,
    /// Smallest value allowed.
    pub(super) at_least: Option<f64>,
    /// Largest value allowed.
    pub(super) at_most: Option<f64>,
}

impl Condition {
    /// Returns true if the condition is empty.
    pub(super) const fn is_empty(&self) -> bool {
        self.equals.is_none() && self.not_equals.is_none() && self.at_least.is_none() && self.at_most.is_none()
    }
}

/// A value that a condition names.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number or text")]
pub enum Wanted {
    /// A number, however it is written.
    Number(f64),
    /// Text.
    Text(String),
}

/// A channel: its columns and how they are combined. Use one of `column`, `columns`, `enu`, `speed` with `course`,
/// `quaternion`, `dcm`, `rpy`, `euler`, `latitude` with `longitude` and `height`, `ecef`, `utm`, or `north` with
/// `east` and `down` or `up`.
///
/// A column is written as in the header; a minus sign before it changes the sign of its values.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelSpec {
    /// The column of a single number; for an array of columns, their sum.
    pub(super) column: Option<OneOrMany<String>>,
    /// The columns of a vector; an array instead of a column gives the sum of its columns.
    pub(super) columns: Option<Vec<OneOrMany<String>>>,
    /// The columns of a vector, or of its 1σ, along east, north and up; gives a vector along north, east and down.
    pub(super) enu: Option<[String; 3]>,
    /// The column of the speed over ground, with its `course`; makes a velocity north, east, down.
    pub(super) speed: Option<OneColumn>,
    /// The column of the course over ground, clockwise from north.
    pub(super) course: Option<OneColumn>,
    /// The columns of a quaternion w x y z, body to navigation.
    pub(super) quaternion: Option<[String; 4]>,
    /// The columns of a rotation matrix, row by row, from body to navigation axes; makes a quaternion.
    pub(super) dcm: Option<[String; 9]>,
    /// The columns of roll, pitch and heading, in this sequence of turns from the body back to navigation axes;
    /// makes a quaternion. A heading counted anti-clockwise from east is `"-yaw"` with an `offset` of
    /// `[0, 0, "90 deg"]`.
    pub(super) rpy: Option<[String; 3]>,
    /// Three angles in another sequence of turns; makes a quaternion.
    pub(super) euler: Option<EulerSpec>,
    /// The column of the latitude; makes a geodetic position.
    pub(super) latitude: Option<String>,
    /// The column of the longitude.
    pub(super) longitude: Option<String>,
    /// The column of the ellipsoidal height; also for `utm`.
    pub(super) height: Option<String>,
    /// The columns of Earth-centred Earth-fixed x, y and z; makes a geodetic position.
    pub(super) ecef: Option<[String; 3]>,
    /// Easting and northing of a zone of Universal Transverse Mercator (WGS-84), with `height`; makes a
    /// geodetic position.
    pub(super) utm: Option<UtmSpec>,
    /// The column of metres north of the declared origin; makes a geodetic position.
    pub(super) north: Option<String>,
    /// The column of metres east of the origin.
    pub(super) east: Option<String>,
    /// The column of metres below the origin; with `speed` and `course`, of the velocity down.
    pub(super) down: Option<OneColumn>,
    /// The column of the upward value, instead of `down`.
    pub(super) up: Option<OneColumn>,
    /// The unit of the columns, such as `deg/s`. Without it, the unit in brackets at the end of their names,
    /// as in `gyro_x [deg/s]`; otherwise a pure number (also with `unit = ""`). For latitude and longitude and for
    /// roll, pitch, heading: `rad` or `deg`; for latitude and longitude also `ddmm`, degrees and minutes as NMEA
    /// writes them (`4854.554` is 48° 54.554'). For `speed` with `course`: the unit of the speeds.
    pub(super) unit: Option<String>,
    /// The unit of the height. Without it, the unit in brackets at the end of its column's name, otherwise metres.
    pub(super) height_unit: Option<String>,
    /// Factors on the columns, one for all or one each.
    pub(super) scale: Option<OneOrMany<f64>>,
    /// Added after unit and scale, one for all or one each.
    pub(super) offset: Option<PerAxis>,
    /// The columns hold variances: the square root is taken. `unit` is the unit of the columns.
    #[serde(default)]
    pub(super) variance: bool,
    /// The columns hold increments over the interval that ends at the stamp: they become rates.
    #[serde(default)]
    pub(super) increment: bool,
    /// The columns hold instantaneous samples: the mean of this and the previous sample is taken as the rate
    /// over the interval between them.
    #[serde(default)]
    pub(super) average: bool,
    /// From sensor axes to body axes: x_body = R x_sensor. For a quaternion: its body side.
    pub(super) rotation: Option<RotationSpec>,
    /// From the file's world axes to north-east-down: the navigation side of a quaternion.
    pub(super) navigation_rotation: Option<RotationSpec>,
    /// The quaternion maps navigation to body.
    #[serde(default)]
    pub(super) inverse: bool,
    /// Conditions that a row has to meet for this channel to have numbers; other channels of the row are not affected.
    #[serde(default)]
    pub(super) valid: OneOrMany<Condition>,
    /// How late the stamp is: the values are valid at stamp − latency; at most 1 h.
    #[serde(default)]
    pub(super) latency: Duration,
}

/// A column that may have a separate unit: its name, or `{ column = "SOG", unit = "kn" }`.
#[derive(Clone, Debug)]
pub(in super::super) struct OneColumn {
    pub(super) column: String,
    pub(super) unit: Option<String>,
}

/// A column with its unit.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ColumnTable {
    /// The column.
    column: String,
    /// Its unit.
    unit: Option<String>,
}

impl<'de> Deserialize<'de> for OneColumn {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Written;

        impl<'de> Visitor<'de> for Written {
            type Value = OneColumn;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a column, or a table with `column` and `unit`")
            }

            fn visit_str<E: Error>(self, v: &str) -> Result<OneColumn, E> {
                Ok(OneColumn {
                    column: v.to_owned(),
                    unit: None,
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<OneColumn, A::Error> {
                let ColumnTable { column, unit } = ColumnTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(OneColumn { column, unit })
            }
        }

        deserializer.deserialize_any(Written)
    }
}

impl JsonSchema for OneColumn {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "OneColumn".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = generator.subschema_for::<ColumnTable>();
        json_schema!({ "anyOf": [{ "type": "string" }, table] })
    }
}

/// Angles about the axes of turns.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in super::super) struct EulerSpec {
    /// The axis of each turn from navigation to body axes. Each turn is about an axis that the earlier turns have
    /// moved: `"zyx"` is heading, pitch, roll. About fixed axes the sequence is the reverse.
    pub(super) order: String,
    /// The columns of the angles, in this sequence.
    pub(super) columns: [String; 3],
}

/// A place on the grid.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in super::super) struct UtmSpec {
    /// The column of the easting.
    pub(super) easting: String,
    /// The column of the northing.
    pub(super) northing: String,
    /// The zone, 1 to 60.
    pub(super) zone: u8,
    /// The hemisphere.
    pub(super) hemisphere: Hemisphere,
}

/// The hemisphere of the northings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub(in super::super) enum Hemisphere {
    /// From the equator on.
    North,
    /// With 10 000 km at the equator.
    South,
}

/// A fixed rotation.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(in super::super) struct RotationSpec {
    /// Roll, pitch, yaw of the inner axes against the outer.
    pub(super) rpy: Option<Vec3Of<dim::Angle>>,
    /// The inner axis along each outer one: `["-x", "y", "-z"]`.
    pub(super) axes: Option<[String; 3]>,
}
