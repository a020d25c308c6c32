//! A stream of decoded rows, and a row of it.

use super::{ProvidedChannel, SourceError, SourceReport};
use core::fmt::Debug;
use core::ops::Range;
use fusion_core::time::Time;
use fusion_models::block::Channel;

/// The time and number of a row in its stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Its time.
    pub time: Time,
    /// When the row arrives, in the time of the log; it orders the rows of several sources. It differs from
    /// `time` if a fault changes the clock or the order.
    pub arrival: Time,
    /// The line of a text file, or the count of simulated rows, from 1.
    pub number: u64,
}

impl Stamp {
    /// The stamp of a row without delay: it arrives at `time`.
    #[must_use]
    pub const fn new(time: Time, number: u64) -> Self {
        Self {
            time,
            arrival: time,
            number,
        }
    }
}

/// A stream of rows.
pub trait RowStream: Debug + Send {
    /// The channels of a row.
    fn channels(&self) -> &[ProvidedChannel];

    /// Writes the numbers of the next row and returns its stamp; `None` after the last.
    ///
    /// # Errors
    /// The data are invalid; the stream ends then.
    fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError>;

    /// The numbers of the last row that a fault changed.
    fn disturbed(&self) -> &[Range<usize>] {
        &[]
    }

    /// The numbers of its rows that declared faults may change.
    fn disturbable(&self) -> Vec<Range<usize>> {
        Vec::new()
    }

    /// The report of the rows read so far.
    fn report(&self) -> SourceReport;
}

/// The width of a row.
#[must_use]
pub fn width(channels: &[ProvidedChannel]) -> usize {
    channels.iter().map(|c| c.offset + c.channel.width).max().unwrap_or(0)
}

/// Channels, each with its delay in nanoseconds, one after the other in a row.
#[must_use]
pub fn provided(channels: impl IntoIterator<Item = (Channel, i64)>) -> Vec<ProvidedChannel> {
    let mut end = 0;
    let place = |(channel, delay_ns): (Channel, i64)| {
        let offset = end;
        end += channel.width;
        ProvidedChannel { channel, offset, delay_ns }
    };
    channels.into_iter().map(place).collect()
}

#[cfg(test)]
pub(super) mod testing {
    use super::super::{DataError, RowCounts};
    use super::*;

    /// Rows held in memory: one number each, or an error in their place.
    #[derive(Debug)]
    struct Listed {
        rows: std::vec::IntoIter<Result<(f64, f64), &'static str>>,
        channels: Vec<ProvidedChannel>,
        counts: RowCounts,
    }

    pub(in super::super) fn listed(rows: Vec<Result<(f64, f64), &'static str>>) -> Box<dyn RowStream> {
        use fusion_models::units::{Dimensional, dim};
        let channel = Channel::vector("speed", 1, dim::Speed::KIND.dimension);
        Box::new(Listed {
            rows: rows.into_iter(),
            channels: provided([(channel, 0)]),
            counts: RowCounts::default(),
        })
    }

    impl RowStream for Listed {
        fn channels(&self) -> &[ProvidedChannel] {
            &self.channels
        }

        fn next(&mut self, values: &mut Vec<f64>) -> Result<Option<Stamp>, SourceError> {
            let Some(next) = self.rows.next() else { return Ok(None) };
            let (t, value) = next.map_err(|what| DataError::new("listed", what))?;
            values.clear();
            values.push(value);
            let time = Time::from_seconds(t);
            self.counts.row();
            self.counts.used(time);
            let number = self.counts.rows();
            Ok(Some(Stamp::new(time, number)))
        }

        fn report(&self) -> SourceReport {
            self.counts.report()
        }
    }
}
