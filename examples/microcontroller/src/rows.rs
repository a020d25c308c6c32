//! The rows of `rows.bin`, and the instructions that they cost.

use semihosting::fs::File;
use semihosting::io::Read;
use semihosting::println;

/// The instructions of the rows of one stream.
#[derive(Clone, Copy, Default)]
pub struct Cost {
    rows: u64,
    all: u64,
    most: u32,
}

impl Cost {
    /// Counts a row.
    pub fn add(&mut self, instructions: u32) {
        (self.rows, self.all, self.most) = (self.rows + 1, self.all + u64::from(instructions), self.most.max(instructions));
    }

    /// Prints the number of rows, their mean and the largest, if there are any.
    pub fn print(&self, name: &str) {
        if self.rows > 0 {
            println!("rows {name} {} {} {}", self.rows, self.all / self.rows, self.most);
        }
    }
}

/// The bytes of `rows.bin`, many at a time: each call of semihosting stops the processor.
pub struct Source {
    file: File,
    bytes: [u8; 1024],
    at: usize,
    end: usize,
}

impl Source {
    pub fn open() -> Result<Self, &'static str> {
        let file = File::open(c"rows.bin").map_err(|_| "`rows.bin` cannot be read")?;
        Ok(Self {
            file,
            bytes: [0; 1024],
            at: 0,
            end: 0,
        })
    }

    /// Calls `work` with the stream, the stamp \[ns\] and the numbers of each row. `widths` are those of the streams.
    pub fn each_row(
        &mut self,
        widths: &[usize],
        row: &mut [f64; 64],
        mut work: impl FnMut(usize, i64, &[f64]) -> Result<(), &'static str>,
    ) -> Result<(), &'static str> {
        const CUT: &str = "`rows.bin` ends within a row";
        while let Some(stream) = self.next() {
            let stream = u32::from_le_bytes(stream) as usize;
            let width = *widths.get(stream).ok_or("there is no such stream")?;
            let row = row.get_mut(..width).ok_or("a row has more than 64 numbers")?;
            let time = i64::from_le_bytes(self.next().ok_or(CUT)?);
            for value in &mut *row {
                *value = f64::from_le_bytes(self.next().ok_or(CUT)?);
            }
            work(stream, time, row)?;
        }
        Ok(())
    }

    /// The next bytes; `None` at the end of the file.
    fn next<const N: usize>(&mut self) -> Option<[u8; N]> {
        let mut next = [0; N];
        for byte in &mut next {
            if self.at == self.end {
                (self.at, self.end) = (0, self.file.read(&mut self.bytes).ok()?);
            }
            *byte = *self.bytes[..self.end].get(self.at)?;
            self.at += 1;
        }
        Some(next)
    }
}
