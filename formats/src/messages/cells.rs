//! The cells of one message.

use fusion::source::decode::Cell;

/// The cells of one message. They are filled anew for each message, so that nothing is allocated once they have grown.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    values: Vec<Value>,
    text: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
enum Value {
    Number(f64),
    Integer(i64),
    /// Its bytes in the common text; an empty cell has none.
    Text(usize, usize),
}

impl Cells {
    pub(crate) fn clear(&mut self) {
        self.values.clear();
        self.text.clear();
    }

    /// Bytes of memory.
    pub(super) fn size(&self) -> usize {
        size_of::<Value>() * self.values.len() + self.text.len()
    }

    #[inline]
    pub(crate) fn get(&self, column: usize) -> Cell<'_> {
        match self.values.get(column) {
            Some(Value::Number(number)) => Cell::Number(*number),
            Some(Value::Integer(number)) => Cell::Integer(*number),
            Some(Value::Text(from, to)) => Cell::Text(&self.text[*from..*to]),
            None => Cell::Text(&[]),
        }
    }

    /// A cell as text.
    #[cfg(test)]
    pub(crate) fn shown(&self, column: usize) -> String {
        self.get(column).shown().into_owned()
    }

    /// The number of cells so far.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is no cell so far.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Adds a number.
    pub fn number(&mut self, number: f64) {
        self.values.push(Value::Number(number));
    }

    /// Adds numbers.
    #[cfg(any(feature = "mcap", feature = "rosbag", feature = "rosbag2"))]
    #[inline]
    pub(crate) fn numbers(&mut self, numbers: impl ExactSizeIterator<Item = f64>) {
        self.values.extend(numbers.map(Value::Number));
    }

    /// Adds a whole number, which stays exact.
    pub fn integer(&mut self, number: i64) {
        self.values.push(Value::Integer(number));
    }

    /// Adds a whole number without a sign. It stays exact below 2⁶³.
    pub fn unsigned(&mut self, number: u64) {
        match i64::try_from(number) {
            Ok(number) => self.integer(number),
            Err(_) => self.number(number as f64),
        }
    }

    /// Adds a text.
    pub fn text(&mut self, text: &[u8]) {
        let from = self.text.len();
        self.text.extend_from_slice(text);
        self.values.push(Value::Text(from, self.text.len()));
    }

    /// Adds a cell without content.
    pub fn empty(&mut self) {
        self.text(&[]);
    }

    /// Adds this number of cells without content.
    pub fn blanks(&mut self, count: usize) {
        let values = self.values.len() + count;
        self.values.resize(values, Value::Text(0, 0));
    }

    /// Puts the last cell in place of the cell in this column.
    pub fn move_last(&mut self, column: usize) {
        if let Some(last) = self.values.pop() {
            self.values[column] = last;
        }
    }

    /// Puts the cell in column `from` in place of the cell in column `to`.
    pub fn copy(&mut self, from: usize, to: usize) {
        self.values[to] = self.values[from];
    }
}
