//! updates.csv.

use super::Cells;
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::time::Time;
use std::io::{self, Write};

/// Writes updates.csv: one row per measurement.
#[derive(Debug)]
pub(crate) struct UpdateWriter<W: Write> {
    cells: Cells<W>,
    rows: usize,
}

impl<W: Write> UpdateWriter<W> {
    /// Writes the header for residuals of up to `rows` numbers.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn new(out: W, rows: usize) -> io::Result<Self> {
        let mut cells = Cells::new(out);
        cells.texts(["t_s", "sensor", "verdict", "nis", "statistic", "threshold", "mode", "weight"])?;
        for what in ["residual", "sigma"] {
            (0..rows).try_for_each(|i| cells.put(format_args!("{what}_{i}")))?;
        }
        cells.end()?;
        // A full disk is reported before the run.
        cells.flush()?;
        Ok(Self { cells, rows })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&mut self, time: Time, sensor: &str, u: &Update<'_>) -> io::Result<()> {
        self.cells.fixed(time.seconds(), 6);
        self.cells.texts([sensor, verdict_name(u.verdict)])?;
        [u.nis, u.statistic, u.threshold].into_iter().for_each(|value| self.number(value));
        self.cells.text(if u.mode == Mode::Track { "track" } else { "denied" })?;
        self.number(u.weight);
        for values in [u.residual, u.innovation_sigma] {
            (0..self.rows).for_each(|i| self.number(values.get(i).copied().unwrap_or(f64::NAN)));
        }
        self.cells.end()
    }

    /// A number, or an empty cell for NaN.
    fn number(&mut self, value: f64) {
        if value.is_nan() {
            self.cells.empty(1);
        } else {
            self.cells.scientific(value, 6);
        }
    }

    /// Writes the buffered text.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn flush(&mut self) -> io::Result<()> {
        self.cells.flush()
    }

    /// The writer; it does not have the buffered text yet.
    pub fn sink(&self) -> &W {
        self.cells.sink()
    }

    /// Writes the buffered text, and returns the writer.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn finish(self) -> io::Result<W> {
        self.cells.finish()
    }
}

/// The verdict as updates.csv and the summary spell it.
#[must_use]
pub const fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Accepted => "accepted",
        Verdict::Rejected => "rejected",
        Verdict::Reacquired => "reacquired",
        Verdict::Undefined(_) => "undefined",
        Verdict::Unusable => "unusable",
    }
}
