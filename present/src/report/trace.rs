//! Time series in bounded memory.
//!
//! A [`Trace`] keeps the extremes of every channel in buckets of equally many samples; when all
//! buckets are full, neighbours merge and buckets hold twice as many from then on. A drawing with
//! one pixel per bucket looks like the whole series. [`Samples`] keeps whole samples instead,
//! every n-th of them, where channels belong together: the points of a path.

use fusion_core::memory::{Memory, Tape};

/// A merged row has this many numbers per channel: its two extremes in the order they came.
const ENDS: usize = 2;

/// The extremes of several channels over one time base.
#[derive(Clone, Debug)]
pub struct Trace {
    channels: usize,
    capacity: usize,
    /// Samples that a full bucket holds.
    stride: u64,
    /// Samples in the last bucket.
    filled: u64,
    /// First and last time of each bucket \[s\].
    spans: Vec<(f64, f64)>,
    /// Per bucket and channel, the two extremes in the order they came; NaN without values.
    ends: Vec<[f32; ENDS]>,
}

impl Memory for Trace {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.stride.remember(tape);
        self.filled.remember(tape);
        self.spans.remember(tape);
        self.ends.remember(tape);
        if self.ends.len() != self.channels * self.spans.len() || self.spans.len() > self.capacity {
            tape.refuse("a trace has another size");
        }
    }
}

/// A trace laid out for drawing: one or two rows per bucket.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Values per channel; NaN for a missing value.
    pub values: Vec<Vec<f32>>,
}

impl Trace {
    /// Of `channels` series in at most `capacity` buckets.
    #[must_use]
    pub fn new(channels: usize, capacity: usize) -> Self {
        let capacity = capacity.max(2).next_multiple_of(2);
        Self {
            channels,
            capacity,
            stride: 1,
            filled: 0,
            spans: Vec::new(),
            ends: Vec::new(),
        }
    }

    /// Whether nothing has been pushed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }

    /// First and last time \[s\].
    #[must_use]
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((self.spans.first()?.0, self.spans.last()?.1))
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.spans.capacity() * size_of::<(f64, f64)>() + self.ends.capacity() * size_of::<[f32; ENDS]>()
    }

    /// Adds a sample; a channel that has no value at this time is NaN.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        debug_assert_eq!(values.len(), self.channels, "one value per channel");
        if self.spans.is_empty() || self.filled == self.stride {
            if self.spans.len() == self.capacity {
                self.halve();
            }
            if self.spans.is_empty() || self.filled == self.stride {
                self.spans.push((time, time));
                self.ends.resize(self.spans.len() * self.channels, [f32::NAN; ENDS]);
                self.filled = 0;
            }
        }
        self.filled += 1;
        if let Some(span) = self.spans.last_mut() {
            span.1 = time;
        }
        let from = self.ends.len() - self.channels;
        for (ends, value) in self.ends[from..].iter_mut().zip(values) {
            widen(ends, *value as f32);
        }
    }

    fn halve(&mut self) {
        let merged = self.merged(2);
        // The capacity is even, so that every bucket has found its partner and is full.
        (self.spans, self.ends) = merged;
        self.stride *= 2;
        self.filled = self.stride;
    }

    /// Buckets with `every` neighbours merged into one.
    fn merged(&self, every: usize) -> (Vec<(f64, f64)>, Vec<[f32; ENDS]>) {
        let mut spans = Vec::with_capacity(self.capacity);
        let mut ends = Vec::with_capacity(self.capacity * self.channels);
        for (group, rows) in self.spans.chunks(every).zip(self.ends.chunks(every * self.channels)) {
            spans.push((group[0].0, group[group.len() - 1].1));
            for channel in 0..self.channels {
                let mut both = [f32::NAN; ENDS];
                for row in rows.chunks(self.channels) {
                    row[channel].iter().for_each(|v| widen(&mut both, *v));
                }
                ends.push(both);
            }
        }
        (spans, ends)
    }

    /// Rows that [`columns`](Self::columns) would have at most, breaks apart.
    #[must_use]
    pub fn rows(&self, capacity: usize) -> usize {
        let buckets = self.spans.len();
        let merged = buckets.div_ceil(buckets.div_ceil(capacity.max(1)).max(1));
        if self.stride == 1 && merged == buckets {
            merged
        } else {
            ENDS * merged
        }
    }

    /// Channels.
    #[must_use]
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// The series in at most `capacity` buckets; with `breaks`, a row of NaN interrupts the line
    /// where samples are missing.
    #[must_use]
    pub fn columns(&self, capacity: usize, breaks: bool) -> Columns {
        let every = self.spans.len().div_ceil(capacity.max(1)).max(1);
        let (spans, ends) = self.merged(every);
        let longest = if breaks { longest_step(&spans) } else { f64::INFINITY };
        let mut columns = Columns {
            time: Vec::new(),
            values: vec![Vec::new(); self.channels],
        };
        let mut row = |time: f64, value: &dyn Fn(usize) -> f32| {
            columns.time.push(time);
            columns.values.iter_mut().enumerate().for_each(|(c, v)| v.push(value(c)));
        };
        for (i, span) in spans.iter().enumerate() {
            let own = &ends[i * self.channels..(i + 1) * self.channels];
            if i > 0 && span.0 - spans[i - 1].1 > longest {
                row(0.5 * (span.0 + spans[i - 1].1), &|_| f32::NAN);
            }
            row(span.0, &|c| own[c][0]);
            if span.1 > span.0 {
                row(span.1, &|c| own[c][1]);
            }
        }
        columns
    }
}

/// Takes `value` into the extremes, keeping their order of appearance.
fn widen(ends: &mut [f32; ENDS], value: f32) {
    let [a, b] = *ends;
    if value.is_nan() {
    } else if a.is_nan() {
        *ends = [value, value];
    } else if value < a.min(b) {
        *ends = [a.max(b), value];
    } else if value > a.max(b) {
        *ends = [a.min(b), value];
    }
}

/// Steps between buckets longer than this are gaps \[s\]: ten of the usual ones.
fn longest_step(spans: &[(f64, f64)]) -> f64 {
    let mut steps: Vec<f64> = spans.windows(2).map(|w| w[1].0 - w[0].1).collect();
    if steps.is_empty() {
        return f64::INFINITY;
    }
    let middle = steps.len() / 2;
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    10.0 * usual
}

/// Every n-th of a series of points with their times, n doubling as they fill up.
#[derive(Clone, Debug)]
pub struct Samples<const N: usize> {
    capacity: usize,
    stride: u64,
    seen: u64,
    rows: Vec<(f64, [f64; N])>,
    last: Option<(f64, [f64; N])>,
}

impl<const N: usize> Memory for Samples<N> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.stride.remember(tape);
        self.seen.remember(tape);
        let nothing = (0.0, [0.0; N]);
        let length = tape.length(self.rows.len(), 8);
        self.rows.resize(length, nothing);
        self.rows.as_mut_slice().remember(tape);
        let mut has_last = self.last.is_some();
        has_last.remember(tape);
        self.last = has_last.then(|| {
            let mut last = self.last.unwrap_or(nothing);
            last.remember(tape);
            last
        });
        if self.stride == 0 {
            tape.refuse("every 0th sample");
        }
    }
}

impl<const N: usize> Samples<N> {
    /// At most `capacity` points.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            capacity: capacity.max(2),
            stride: 1,
            seen: 0,
            rows: Vec::new(),
            last: None,
        }
    }

    /// Adds a point.
    pub fn push(&mut self, time: f64, point: [f64; N]) {
        if self.seen.is_multiple_of(self.stride) {
            if self.rows.len() == self.capacity {
                let mut index = 0_u64;
                self.rows.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            if self.seen.is_multiple_of(self.stride) {
                self.rows.push((time, point));
            }
        }
        self.seen += 1;
        self.last = Some((time, point));
    }

    /// The points kept, and the very last one.
    pub fn iter(&self) -> impl Iterator<Item = (f64, &[f64; N])> {
        let last = self.last.as_ref().filter(|l| self.rows.last().is_some_and(|r| r.0 < l.0));
        self.rows.iter().chain(last).map(|(t, p)| (*t, p))
    }

    /// Whether nothing has been pushed.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Bytes held.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.rows.capacity() * size_of::<(f64, [f64; N])>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(i: usize) -> f64 {
        // Irregular, with single spikes that plain thinning would lose.
        let spike = if i == 77_777 { 50.0 } else { 0.0 } - if i == 123_456 { 60.0 } else { 0.0 };
        (i as f64 * 0.013).sin() + 0.1 * (i as f64 * 7.7).cos() + spike
    }

    #[test]
    fn decimation_keeps_extremes_of_every_stretch() {
        let mut trace = Trace::new(2, 1024);
        let n = 200_000;
        for i in 0..n {
            trace.push(i as f64 * 0.01, &[wave(i), -2.0 * wave(i)]);
        }
        for capacity in [1024, 300, 7] {
            let columns = trace.columns(capacity, true);
            assert!(
                columns.time.len() <= 2 * capacity,
                "{} rows in {capacity} buckets",
                columns.time.len()
            );
            assert!(columns.time.is_sorted());
            let (low, high) = columns.values[0]
                .iter()
                .fold((0.0, 0.0), |(l, h), v| (f32::min(l, *v), f32::max(h, *v)));
            let exact = (0..n).map(wave).fold((0.0, 0.0), |(l, h), v| (f64::min(l, v), f64::max(h, v)));
            assert_eq!((low, high), (exact.0 as f32, exact.1 as f32));
        }
        // And so does every bucket for itself: its rows span the extremes of its samples.
        let columns = trace.columns(1024, true);
        for rows in 0..columns.time.len() / 2 {
            let (from, to) = (columns.time[2 * rows], columns.time[2 * rows + 1]);
            let samples = (f64::round(from * 100.0) as usize)..=(f64::round(to * 100.0) as usize);
            let most = samples.map(|i| wave(i) as f32).fold(f32::MIN, f32::max);
            assert_eq!(columns.values[0][2 * rows].max(columns.values[0][2 * rows + 1]), most);
        }
    }

    #[test]
    fn extremes_stay_in_the_order_they_came() {
        let mut trace = Trace::new(1, 2);
        for (i, v) in [3.0, 1.0, 2.0, 0.0, 5.0, 4.0, 9.0, 8.0].iter().enumerate() {
            trace.push(i as f64, &[*v]);
        }
        let columns = trace.columns(2, false);
        assert_eq!(columns.time, [0.0, 3.0, 4.0, 7.0]);
        assert_eq!(columns.values, [[3.0, 0.0, 4.0, 9.0]]);
    }

    #[test]
    fn a_short_series_is_kept_as_it_is() {
        let mut trace = Trace::new(1, 100);
        (0..50).for_each(|i| trace.push(f64::from(i), &[f64::from(i * i)]));
        let columns = trace.columns(100, true);
        assert_eq!(columns.time.len(), 50);
        assert_eq!(columns.values[0][7], 49.0);
    }

    #[test]
    fn a_gap_breaks_the_line_and_missing_values_do_not_spread() {
        let mut trace = Trace::new(2, 100);
        for i in (0..20).chain(60..80) {
            trace.push(f64::from(i), &[1.0, if i == 3 { f64::NAN } else { 2.0 }]);
        }
        let columns = trace.columns(100, true);
        assert_eq!(columns.time.len(), 41);
        assert!(columns.values[0][20].is_nan(), "the break");
        assert!(columns.values[1][3].is_nan());
        assert!(
            !trace.columns(10, true).values[1].iter().take(4).any(|v| v.is_nan()),
            "a bucket ignores what is missing"
        );
    }

    #[test]
    fn memory_does_not_grow_with_the_log() {
        let mut trace = Trace::new(6, 4096);
        let mut path = Samples::<2>::new(4096);
        let mut held = Vec::new();
        for i in 0..1_440_000 {
            let t = f64::from(i) * 0.01;
            trace.push(t, &[t.sin(); 6]);
            path.push(t, [t, -t]);
            if i == 20_000 || i == 1_439_999 {
                held.push((trace.bytes(), path.bytes()));
            }
        }
        assert_eq!(held[0], held[1]);
        assert!(held[1].0 <= 4096 * (16 + 6 * 8) * 2, "{} bytes", held[1].0);
        let points: Vec<_> = path.iter().collect();
        assert!((2048..=4097).contains(&points.len()));
        assert_eq!(points[points.len() - 1].0, 14_399.99);
        assert_eq!(points[0].0, 0.0);
    }
}
