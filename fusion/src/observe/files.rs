//! Files that are written during a run.

use super::{Filters, Heard, RunEvent, RunObserver};
use crate::output::{EstimateWriter, FileSet, Origin, OutputFile, Sink, Unwritable, UpdateWriter};
use fusion_core::memory::{Memory, Tape};
use fusion_core::runner::{Event, Halt};
use fusion_core::time::Time;
use std::io::{self, Write};
use std::path::PathBuf;

/// A file that is being written, with its writer.
#[derive(Debug)]
struct Written<T> {
    path: PathBuf,
    writer: T,
    /// Its length when its memory was saved.
    length: u64,
}

/// The writer of a file.
trait Writer {
    fn flush(&mut self) -> io::Result<()>;
    fn sink(&self) -> &impl Sink;
}

impl<W: Sink> Writer for EstimateWriter<W> {
    fn flush(&mut self) -> io::Result<()> {
        Self::flush(self)
    }

    fn sink(&self) -> &impl Sink {
        Self::sink(self)
    }
}

impl<W: Sink> Writer for UpdateWriter<W> {
    fn flush(&mut self) -> io::Result<()> {
        Self::flush(self)
    }

    fn sink(&self) -> &impl Sink {
        Self::sink(self)
    }
}

impl<T> Written<T> {
    /// `name` among the files of `set`; `begin` writes its header.
    fn create(set: &FileSet, name: &str, begin: impl FnOnce(OutputFile) -> io::Result<T>) -> Result<Self, Unwritable> {
        let file = set.create(name)?;
        let path = file.path().to_owned();
        match begin(file) {
            Ok(writer) => Ok(Self { path, writer, length: 0 }),
            Err(error) => Err(Unwritable { path, error }),
        }
    }

    fn write(&mut self, write: impl FnOnce(&mut T) -> io::Result<()>) -> Result<(), Unwritable> {
        write(&mut self.writer).map_err(|error| Unwritable {
            path: self.path.clone(),
            error,
        })
    }

    fn finish<W>(self, finish: impl FnOnce(T) -> io::Result<W>) -> Result<W, Unwritable> {
        let Self { path, writer, .. } = self;
        finish(writer).map_err(|error| Unwritable { path, error })
    }
}

impl<T: Writer> Written<T> {
    fn flush(&mut self) -> Result<(), Unwritable> {
        self.write(|writer| {
            writer.flush()?;
            writer.sink().sync()
        })?;
        self.length = self.writer.sink().length();
        Ok(())
    }

    fn resume(&mut self) -> Result<(), Unwritable> {
        let length = self.length;
        self.write(|writer| {
            // Flushes the header, which is already in the buffer.
            writer.flush()?;
            writer.sink().cut(length)
        })
    }
}

/// Selects the estimates that have a row: the first in each period of time.
#[derive(Clone, Copy, Debug)]
pub struct Thinning {
    /// One row per period of this length \[ns\]; 0 for every estimate.
    period: i64,
    next: Time,
}

fusion_core::memory!(Thinning { next; period });

impl Thinning {
    /// One row per `period` \[ns\]; 0 for every estimate.
    #[must_use]
    pub const fn new(period: i64) -> Self {
        Self { period, next: Time::MIN }
    }

    /// Returns true if the estimate at `time`, later than all before it, has a row.
    pub fn takes(&mut self, time: Time) -> bool {
        if time < self.next {
            return false;
        }
        if self.period > 0 {
            let slot = time.nanos().div_euclid(self.period) + 1;
            self.next = Time::from_nanos(slot.saturating_mul(self.period));
        }
        true
    }
}

/// Writes the estimates of one filter: estimates.csv, or `estimates.STAGE.csv` for a filter inside a stage.
#[derive(Debug)]
pub(crate) struct EstimateFile<W: Write = OutputFile> {
    file: Written<EstimateWriter<W>>,
    /// The filter's number.
    filter: usize,
    thinning: Thinning,
}

impl EstimateFile {
    /// Creates the file in `set`, with a name that begins with `name`. Local coordinates start at `origin`, or at the
    /// first position.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(set: &FileSet, name: &str, filter: &Heard, origin: Origin, thinning: Thinning) -> Result<Self, Unwritable> {
        let file = Written::create(set, &name_of(name, filter), |file| {
            EstimateWriter::new(file, &filter.layout, origin)
        })?;
        Ok(Self {
            file,
            filter: filter.number,
            thinning,
        })
    }
}

impl<W: Write> EstimateFile<W> {
    /// Writes the buffered rows and returns the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> Result<W, Unwritable> {
        self.file.finish(EstimateWriter::finish)
    }
}

impl<W: Sink> Memory for EstimateFile<W> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.file.length.remember(tape);
        self.file.writer.remember(tape);
        self.thinning.remember(tape);
    }
}

impl<W: Sink> RunObserver for EstimateFile<W> {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn flush(&mut self) -> Result<(), Halt> {
        Ok(self.file.flush()?)
    }

    fn resume(&mut self) -> Result<(), Halt> {
        Ok(self.file.resume()?)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        let RunEvent::Estimate { filter, solution, belief } = event else {
            return Ok(());
        };
        if filter.number != self.filter || !self.thinning.takes(belief.time) {
            return Ok(());
        }
        Ok(self.file.write(|w| w.write(solution, belief))?)
    }
}

/// The name of a filter's file. A stage may have any name, a file may not: every character other than letters, digits,
/// `_` and `-` is written as its number.
fn name_of(first: &str, filter: &Heard) -> String {
    let mut name = first.to_owned();
    for stage in &filter.stages {
        name.push('.');
        for c in stage.chars() {
            if c.is_alphanumeric() || c == '_' || c == '-' {
                name.push(c);
            } else {
                name += &format!("%{:02X}", u32::from(c));
            }
        }
    }
    name + ".csv"
}

/// Writes updates.csv: the measurements of every filter.
#[derive(Debug)]
pub(crate) struct UpdateFile<W: Write = OutputFile>(Written<UpdateWriter<W>>);

impl UpdateFile {
    /// Creates the file in `set`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(set: &FileSet, filters: &Filters) -> Result<Self, Unwritable> {
        let rows = filters.sensors().map(|s| s.residual).max().unwrap_or(0);
        Ok(Self(Written::create(set, "updates.csv", |file| UpdateWriter::new(file, rows))?))
    }
}

impl<W: Write> UpdateFile<W> {
    /// Writes the buffered rows and returns the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(self) -> Result<W, Unwritable> {
        self.0.finish(UpdateWriter::finish)
    }
}

impl<W: Sink> Memory for UpdateFile<W> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.0.length.remember(tape);
    }
}

impl<W: Sink> RunObserver for UpdateFile<W> {
    fn memory(&mut self) -> Option<&mut dyn Memory> {
        Some(self)
    }

    fn flush(&mut self) -> Result<(), Halt> {
        Ok(self.0.flush()?)
    }

    fn resume(&mut self) -> Result<(), Halt> {
        Ok(self.0.resume()?)
    }

    fn on(&mut self, event: &RunEvent<'_>) -> Result<(), Halt> {
        if let RunEvent::Filter {
            filter,
            event: Event::Updated { sensor, update, time, .. },
        } = event
        {
            let name = &filter.sensors[*sensor].name;
            self.0.write(|w| w.write(*time, name, update))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::Hub;
    use fusion_core::runner::Row;

    /// A disk with room for this number of bytes.
    struct Disk(usize);

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let fits = bytes.len().min(self.0);
            self.0 -= fits;
            Ok(fits)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Sink for Disk {}

    const DESIGN: &str = "
        [process]
        type = 'constant_velocity'
        acceleration_noise = 1
        position_sigma = 10
        velocity_sigma = 5
        [run]
        origin = { latitude = 0.8, longitude = 0.1 }
        [sensor.gnss]
        type = 'gnss_position'
        source = 'gnss'
        noise = { sigma = 2 }
        [initial.start]
        type = 'explicit'
        position = { latitude = 0.8, longitude = 0.1 }
        position_sigma = 5
        velocity = [0, 0, 0]
        velocity_sigma = 1";

    #[test]
    fn a_disk_that_becomes_full_stops_the_run_with_the_name_of_the_file() {
        let mut nav = crate::Navigator::from_toml(DESIGN).unwrap_or_else(|d| panic!("{d}"));
        let filters = Filters::of(nav.assembly());
        let layout = nav.assembly().layout.clone();
        let mut file = EstimateFile {
            file: Written {
                path: PathBuf::from("out/estimates.csv"),
                writer: EstimateWriter::new(Disk(20_000), &layout, Origin::default()).unwrap(),
                length: 0,
            },
            filter: 0,
            thinning: Thinning::new(0),
        };
        let mut hub = Hub::new(&filters, None);
        hub.add(&mut file);
        let fed = (0..10_000).find_map(|k| {
            let row = [0.8, 0.1, 0.0, 0.0, 0.0, 0.0];
            let row = Row::new(0, Time::from_seconds(k as f64), &row[..3]);
            nav.feed_row(&row, &mut hub).err().map(|why| (k, why.to_string()))
        });
        let (rows, why) = fed.unwrap();
        assert!(why.starts_with("cannot write out/estimates.csv: "), "{why}");
        // A row has more than 110 bytes; the buffer holds 32 KiB.
        assert!(rows < 300, "{rows}");
    }
}
