//! Input samples with their neighbours, for corrections by the change from one sample to the next.
//!
//! Sample     x₁ … x_d from the stream, then the neighbour's y₁ … y_d, then ±T_y \[s\], the length
//!            of its interval. The sign is positive if the neighbour comes before, negative if it comes
//!            after. T_y is 0 for the first row of a stream as neighbour, which covers no time
//! Modes      *previous*: the neighbour is the sample before, without delay
//!            *pairs*: samples 1 and 2 are each other's neighbours, then 3 and 4, and so on. The first
//!            of a pair waits for the second. A last sample without partner gets the sample before

use alloc::vec::Vec;
use fusion_core::memory;
use fusion_core::model::{Input, Literal, Preparation, Prepared};

/// Which neighbour a sample gets.
#[derive(Clone, Copy, Debug, Literal, PartialEq, Eq)]
pub enum Mode {
    /// The sample before.
    Previous,
    /// Its partner in the pair.
    Pairs,
}

/// The neighbour of a sample.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour<'a> {
    /// Its numbers, as the stream has them.
    pub sample: &'a [f64],
    /// Length of its interval \[s\]; 0 if it covers no time.
    pub interval: f64,
    /// True if it comes before the sample.
    pub is_earlier: bool,
}

/// The neighbour that a preparation has added to a sample of `dim` numbers; `None` if the sample is held beyond its
/// interval.
#[inline]
#[must_use]
pub fn neighbour<'a>(input: &Input<'a>, dim: usize) -> Option<Neighbour<'a>> {
    // Other preparations may append more numbers.
    let (sample, [signed, ..]) = input.sample.get(dim..)?.split_at_checked(dim)? else {
        return None;
    };
    Some(Neighbour {
        sample,
        interval: signed.abs(),
        is_earlier: *signed >= 0.0,
    })
}

/// A sample and its length.
#[derive(Clone, Debug, Default)]
struct Timed {
    sample: Vec<f64>,
    interval: f64,
}
memory!(Timed { sample, interval });

impl Timed {
    fn hold(&mut self, interval: f64, sample: &[f64]) {
        self.interval = interval;
        self.sample.clear();
        self.sample.extend_from_slice(sample);
    }
}

/// Gives every sample its neighbour.
#[derive(Clone, Debug)]
pub struct Pairing {
    mode: Mode,
    previous: Timed,
    /// The first sample of a pair.
    first: Timed,
    has_first: bool,
}
memory!(Pairing { previous, first, has_first; mode });

impl Pairing {
    /// A pairing that has seen no sample yet.
    #[must_use]
    pub fn new(mode: Mode) -> Self {
        Self {
            mode,
            previous: Timed::default(),
            first: Timed::default(),
            has_first: false,
        }
    }
}

impl Preparation for Pairing {
    fn take(&mut self, interval: f64, sample: &[f64], out: &mut Prepared) {
        if interval == 0.0 {
            self.has_first = false;
            self.previous.hold(interval, sample);
        } else if self.mode == Mode::Previous {
            out.push(sample, &[&self.previous.sample, &[self.previous.interval]]);
            self.previous.hold(interval, sample);
        } else if self.has_first {
            out.push(&self.first.sample, &[sample, &[-interval]]);
            out.push(sample, &[&self.first.sample, &[self.first.interval]]);
            self.previous.hold(interval, sample);
            self.has_first = false;
        } else {
            self.first.hold(interval, sample);
            self.has_first = true;
        }
    }

    fn finish(&mut self, out: &mut Prepared) {
        if core::mem::take(&mut self.has_first) {
            out.push(&self.first.sample, &[&self.previous.sample, &[self.previous.interval]]);
            core::mem::swap(&mut self.previous, &mut self.first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First number, neighbour's number and signed length of the prepared `rows`.
    fn paired(mode: Mode, rows: &[(f64, f64)]) -> Vec<(f64, f64, f64)> {
        let (mut pairing, mut out) = (Pairing::new(mode), Prepared::default());
        rows.iter()
            .for_each(|(interval, value)| pairing.take(*interval, &[*value], &mut out));
        pairing.finish(&mut out);
        out.samples().map(|s| (s[0], s[1], s[2])).collect()
    }

    const ROWS: [(f64, f64); 5] = [(0.0, 1.0), (0.1, 2.0), (0.2, 3.0), (0.3, 4.0), (0.4, 5.0)];

    #[test]
    fn every_sample_gets_the_one_before_and_its_length() {
        let wanted = [(2.0, 1.0, 0.0), (3.0, 2.0, 0.1), (4.0, 3.0, 0.2), (5.0, 4.0, 0.3)];
        assert_eq!(paired(Mode::Previous, &ROWS), wanted);
    }

    #[test]
    fn pairs_get_each_other_and_a_last_one_the_sample_before() {
        let pairs = [(2.0, 3.0, -0.2), (3.0, 2.0, 0.1), (4.0, 5.0, -0.4), (5.0, 4.0, 0.3)];
        assert_eq!(paired(Mode::Pairs, &ROWS), pairs);
        let odd = [(2.0, 3.0, -0.2), (3.0, 2.0, 0.1), (4.0, 3.0, 0.2)];
        assert_eq!(paired(Mode::Pairs, &ROWS[..4]), odd);
    }

    #[test]
    fn what_was_before_a_gap_is_no_neighbour() {
        let rows = [(0.0, 1.0), (0.1, 2.0), (0.0, 7.0), (0.1, 8.0), (0.1, 9.0)];
        let previous = [(2.0, 1.0, 0.0), (8.0, 7.0, 0.0), (9.0, 8.0, 0.1)];
        assert_eq!(paired(Mode::Previous, &rows), previous);
        let mut pairing = Pairing::new(Mode::Pairs);
        let mut out = Prepared::default();
        for (interval, value) in &rows[..2] {
            pairing.take(*interval, &[*value], &mut out);
        }
        pairing.finish(&mut out);
        for (interval, value) in &rows[2..] {
            pairing.take(*interval, &[*value], &mut out);
        }
        let pairs: Vec<_> = out.samples().map(|s| (s[0], s[1], s[2])).collect();
        assert_eq!(pairs, [(2.0, 1.0, 0.0), (8.0, 9.0, -0.1), (9.0, 8.0, 0.1)]);
    }

    #[test]
    fn a_sample_that_is_held_has_no_neighbour() {
        assert!(neighbour(&Input::held(&[1.0, 2.0]), 2).is_none());
        let sample = [1.0, 2.0, 3.0, 4.0, -0.5];
        let found = neighbour(
            &Input {
                sample: &sample,
                interval: 0.1,
            },
            2,
        )
        .unwrap();
        assert_eq!((found.sample, found.interval, found.is_earlier), (&[3.0, 4.0][..], 0.5, false));
    }
}
