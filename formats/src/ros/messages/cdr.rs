//! Messages in CDR, little-endian, as ROS 2 writes them.
//!
//! Source    OMG, Common Data Representation, in the version XCDR1

use fusion::output::pose::Pose;

/// The bytes before the content: they say that it is little-endian.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// A message that is being written. A number of n bytes begins at a multiple of n after the encapsulation.
#[derive(Debug, Default)]
pub(super) struct Cdr(Vec<u8>);

impl Cdr {
    /// Begins a message.
    pub(super) fn begin(&mut self) {
        self.0.clear();
        self.0.extend(ENCAPSULATION);
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }

    fn align(&mut self, to: usize) {
        let content = self.0.len() - ENCAPSULATION.len();
        self.0.resize(ENCAPSULATION.len() + content.next_multiple_of(to), 0);
    }

    pub(super) fn byte(&mut self, byte: u8) {
        self.0.push(byte);
    }

    pub(super) fn whole16(&mut self, number: u16) {
        self.align(2);
        self.0.extend(number.to_le_bytes());
    }

    fn whole32(&mut self, number: u32) {
        self.align(4);
        self.0.extend(number.to_le_bytes());
    }

    /// The number of elements of a sequence.
    pub(super) fn length(&mut self, count: usize) {
        self.whole32(u32::try_from(count).unwrap_or(u32::MAX));
    }

    /// A text ends with a zero, which its length counts.
    pub(super) fn text(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    /// A stamp, of nanoseconds since 1970-01-01.
    pub(super) fn stamp(&mut self, nanos: u64) {
        self.whole32(u32::try_from(nanos / 1_000_000_000).unwrap_or(u32::MAX));
        self.whole32((nanos % 1_000_000_000) as u32);
    }

    /// Numbers without their count.
    pub(super) fn numbers(&mut self, numbers: &[f64]) {
        self.align(8);
        numbers.iter().for_each(|number| self.0.extend(number.to_le_bytes()));
    }

    /// A position, then a quaternion x, y, z, w.
    pub(super) fn pose(&mut self, Pose { p, q }: &Pose) {
        self.numbers(p.as_slice());
        self.numbers(&[q.i, q.j, q.k, q.w]);
    }
}
