//! Reads the selected cells of a message, and jumps over the bytes between them.
//!
//! Values of a fixed size that follow each other are one run. A run begins at a multiple of its first alignment. So all
//! places in it are known before a message is read, and its length is checked once.

use super::cursor::{Cursor, Short};
use super::definition::{Array, Number};
use super::plan::{Step, count};
use crate::messages::Cells;

/// How the bytes of a message become the selected cells.
#[derive(Clone, Debug)]
pub(super) struct Program {
    /// The widest alignment for which it was made.
    pub(super) widest: usize,
    parts: Vec<Part>,
}

#[derive(Clone, Debug)]
enum Part {
    Run(Run),
    Text {
        is_selected: bool,
    },
    /// An array, and its selected elements.
    Numbers {
        of: Number,
        selected: Vec<usize>,
    },
    /// The parts and the number of selected cells of the first elements, and the parts of any other element.
    Elements {
        count: Array,
        first: Vec<(Vec<Part>, usize)>,
        further: Vec<Part>,
    },
}

/// Values of a fixed size.
#[derive(Clone, Debug)]
struct Run {
    align: usize,
    length: usize,
    /// The selected values, and their places after the begin of the run.
    selected: Vec<(usize, Fixed)>,
}

/// A value of a fixed size.
#[derive(Clone, Copy, Debug)]
enum Fixed {
    Number(Number),
    Time {
        is_duration: bool,
    },
    /// Numbers of eight bytes with a fraction, one after the other: most cells of messages are such.
    Floats(usize),
}

impl Fixed {
    const fn number(of: Number) -> Self {
        match of {
            Number::F64 => Self::Floats(1),
            _ => Self::Number(of),
        }
    }
}

impl Program {
    /// The program for these steps. `is_selected` says of each cell, in order, whether it is read. The numbers of a
    /// message are aligned to their size, or to `widest` bytes.
    pub(super) fn new(steps: &[Step], widest: usize, mut is_selected: impl FnMut() -> bool) -> Self {
        Self {
            widest,
            parts: Maker::parts(steps, widest, &mut is_selected).0,
        }
    }

    /// Adds the selected cells of a message.
    pub(super) fn run(&self, cursor: &mut Cursor<'_>, cells: &mut Cells) -> Result<(), Short> {
        run(&self.parts, cursor, cells)
    }
}

fn run(parts: &[Part], cursor: &mut Cursor<'_>, cells: &mut Cells) -> Result<(), Short> {
    for part in parts {
        match part {
            Part::Run(run) => run.read(cursor, cells)?,
            Part::Text { is_selected } => {
                let text = cursor.text()?;
                if *is_selected {
                    cells.text(text);
                }
            }
            Part::Numbers { of, selected } => {
                let length = cursor.length()?;
                if length > 0 {
                    cursor.align(of.size());
                }
                let bytes = cursor.take(length * of.size())?;
                for k in selected {
                    if *k < length {
                        cursor.order.number(*of, bytes, k * of.size(), cells)?;
                    } else {
                        cells.empty();
                    }
                }
            }
            Part::Elements {
                count: array,
                first,
                further,
            } => {
                let length = count(*array, cursor)?;
                for (k, (parts, selected)) in first.iter().enumerate() {
                    if k < length {
                        self::run(parts, cursor, cells)?;
                    } else {
                        cells.blanks(*selected);
                    }
                }
                for _ in first.len()..length {
                    self::run(further, cursor, cells)?;
                }
            }
        }
    }
    Ok(())
}

impl Run {
    /// Selects a value at a place after all others.
    fn select(&mut self, at: usize, value: Fixed) {
        match (self.selected.last_mut(), value) {
            (Some((first, Fixed::Floats(count))), Fixed::Floats(more)) if *first + 8 * *count == at => *count += more,
            _ => self.selected.push((at, value)),
        }
    }

    #[inline]
    fn read(&self, cursor: &mut Cursor<'_>, cells: &mut Cells) -> Result<(), Short> {
        cursor.align(self.align);
        let (order, encoding) = (cursor.order, cursor.encoding);
        let bytes = cursor.take(self.length)?;
        for (at, fixed) in &self.selected {
            match fixed {
                Fixed::Floats(count) => order.floats(*count, bytes, *at, cells)?,
                Fixed::Number(number) => order.number(*number, bytes, *at, cells)?,
                Fixed::Time { is_duration } => cells.integer(order.nanoseconds(bytes, *at, encoding, *is_duration)?),
            }
        }
        Ok(())
    }
}

/// Makes the parts of a program.
struct Maker<'a> {
    widest: usize,
    is_selected: &'a mut dyn FnMut() -> bool,
    parts: Vec<Part>,
    /// Selected cells so far.
    selected: usize,
}

impl Maker<'_> {
    /// The parts of these steps, and the number of their selected cells.
    fn parts(steps: &[Step], widest: usize, is_selected: &mut dyn FnMut() -> bool) -> (Vec<Part>, usize) {
        let mut maker = Maker {
            widest,
            is_selected,
            parts: Vec::new(),
            selected: 0,
        };
        for step in steps {
            maker.step(step);
        }
        (maker.parts, maker.selected)
    }

    fn step(&mut self, step: &Step) {
        match step {
            Step::Number(of) => self.values(*of, 1, &[Fixed::number(*of)]),
            Step::Time { is_duration } => {
                let is_duration = *is_duration;
                self.values(Number::U32, 2, &[Fixed::Time { is_duration }]);
            }
            Step::Filler => self.values(Number::U8, 1, &[]),
            Step::Numbers {
                count: Array::Fixed(0), ..
            } => {}
            Step::Numbers {
                of,
                count: Array::Fixed(count),
                shown,
            } => self.values(*of, *count, &vec![Fixed::number(*of); *shown]),
            Step::Numbers { of, shown, .. } => {
                let selected = (0..*shown).filter(|_| self.select()).collect();
                self.parts.push(Part::Numbers { of: *of, selected });
            }
            Step::Text => {
                let is_selected = self.select();
                self.parts.push(Part::Text { is_selected });
            }
            Step::Elements { count, shown, further } => {
                let mut first = Vec::with_capacity(shown.len());
                for steps in shown {
                    first.push(Self::parts(steps, self.widest, &mut *self.is_selected));
                }
                self.selected += first.iter().map(|(_, selected)| selected).sum::<usize>();
                self.parts.push(Part::Elements {
                    count: *count,
                    first,
                    further: Self::parts(further, self.widest, &mut || false).0,
                });
            }
        }
    }

    /// Whether the next cell is selected.
    fn select(&mut self) -> bool {
        let is_selected = (self.is_selected)();
        self.selected += usize::from(is_selected);
        is_selected
    }

    /// Adds numbers of one size, which are these values, to the current run.
    fn values(&mut self, of: Number, count: usize, values: &[Fixed]) {
        let align = of.size().min(self.widest);
        if !matches!(self.parts.last(), Some(Part::Run(run)) if run.align >= align) {
            self.parts.push(Part::Run(Run {
                align,
                length: 0,
                selected: Vec::new(),
            }));
        }
        let selected: Vec<bool> = values.iter().map(|_| self.select()).collect();
        if let Some(Part::Run(run)) = self.parts.last_mut() {
            let from = run.length.next_multiple_of(align);
            let values = values.iter().enumerate().zip(selected).filter(|(_, is_selected)| *is_selected);
            for ((k, value), _) in values {
                run.select(from + k * of.size(), *value);
            }
            run.length = from.saturating_add(count.saturating_mul(of.size()));
        }
    }
}
