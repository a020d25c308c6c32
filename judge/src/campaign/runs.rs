//! runs.csv.

use super::{Campaign, FailedRun, Outcome, RunHealth, RunRow};
use crate::part::Parts;
use fusion::observe::SensorStatistics;
use fusion::output::Cells;
use fusion::score::BlockScore;
use std::io::{self, Write};

/// runs.csv, row by row: one row per run and no timing, the same file for any number of threads.
///
/// Innovations are in SI units, per residual row from 1. A cell without a value is empty, such as `missed` and `false` for
/// a sensor without declared faults. A failed run has its number, its seed, and its reason in the last column.
#[derive(Debug)]
pub struct Table<W: Write> {
    cells: Cells<W>,
    /// The number of columns.
    width: usize,
}

impl<W: Write> Table<W> {
    /// Writes the names of the columns: those of a run with a result, such as the first.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn begin(out: W, like: Option<&RunRow>) -> io::Result<Self> {
        let mut cells = Cells::new(out);
        header(&mut cells, like)?;
        let width = cells.width();
        cells.end()?;
        Ok(Self { cells, width })
    }

    /// Writes the row of a failed run.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn add_failed(&mut self, run: &FailedRun) -> io::Result<()> {
        self.cells.put(run.run)?;
        self.cells.put(run.seed)?;
        (3..self.width).try_for_each(|_| self.cells.text(""))?;
        self.cells.text(&run.reason)?;
        self.cells.end()
    }

    /// Writes the row of a run.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn add(&mut self, row: &RunRow) -> io::Result<()> {
        let cells = &mut self.cells;
        cells.put(row.run)?;
        cells.put(row.seed)?;
        let nees = row.nees.map(|c| c.map_or(f64::NAN, |c| c.mean));
        for values in [row.rms, row.max, row.velocity_rms, row.attitude_rms, nees] {
            values.into_iter().try_for_each(|value| real(cells, value))?;
        }
        let RunHealth {
            worst, at_the_end, ill, ..
        } = &row.health;
        cells.texts([worst.word(), at_the_end.word()])?;
        for value in [Some(*ill), row.drift_percent, row.drift_rms] {
            real(cells, value.unwrap_or(f64::NAN))?;
        }
        for block in &row.blocks {
            let nees = block.nees.map_or(f64::NAN, |c| c.mean);
            let ends = block.error.iter().zip(&block.sigma).flat_map(|(error, sigma)| [*error, *sigma]);
            [nees].into_iter().chain(ends).try_for_each(|value| real(cells, value))?;
        }
        row.sensors.iter().try_for_each(|sensor| sensor_cells(cells, sensor))?;
        cells.text("")?;
        cells.end()
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn finish(mut self) -> io::Result<()> {
        self.cells.flush()
    }
}

/// Writes runs.csv of the first design of the parts, whose runs are those of `campaign`.
///
/// # Errors
/// The errors of the writer; a part that is damaged.
pub fn write(parts: &Parts, campaign: &Campaign, out: impl Write) -> io::Result<()> {
    let mut table = Table::begin(out, campaign.first())?;
    let mut add = |rows: Vec<Outcome>| match rows.first() {
        Some(Outcome::Ended(row)) => table.add(row),
        Some(Outcome::Failed(run)) => table.add_failed(run),
        None => Ok(()),
    };
    parts.rows(&mut add).map_err(io::Error::other)?;
    table.finish()
}

fn header(cells: &mut Cells<impl Write>, like: Option<&RunRow>) -> io::Result<()> {
    cells.texts(["run", "seed", "rms_n_m", "rms_e_m", "rms_d_m", "max_n_m", "max_e_m", "max_d_m"])?;
    cells.texts([
        "rms_vn_mps",
        "rms_ve_mps",
        "rms_vd_mps",
        "rms_roll_deg",
        "rms_pitch_deg",
        "rms_yaw_deg",
    ])?;
    cells.texts(["nees_position", "nees_velocity", "nees_attitude"])?;
    cells.texts(["worst_health", "health_at_end", "ill_share", "drift_percent", "drift_m"])?;
    if let Some(row) = like {
        row.blocks.iter().try_for_each(|block| block_header(cells, block))?;
        row.sensors.iter().try_for_each(|sensor| sensor_header(cells, sensor))?;
    }
    cells.text("error")
}

/// A number, or an empty cell if it is not finite.
fn real(cells: &mut Cells<impl Write>, value: f64) -> io::Result<()> {
    if value.is_finite() {
        cells.put(format_args!("{value:.9e}"))
    } else {
        cells.text("")
    }
}

/// The columns of a block of the state in runs.csv: its NEES, then for each axis from 1 its last error and its 1σ by
/// the filter, SI.
fn block_header(cells: &mut Cells<impl Write>, block: &BlockScore) -> io::Result<()> {
    cells.put(format_args!("{}_nees", block.name))?;
    (1..=block.error.len()).try_for_each(|k| {
        cells.put(format_args!("{}_error_{k}", block.name))?;
        cells.put(format_args!("{}_sigma_{k}", block.name))
    })
}

/// The columns of a sensor in runs.csv.
fn sensor_header(cells: &mut Cells<impl Write>, s: &SensorStatistics) -> io::Result<()> {
    let columns = [
        "nis",
        "accepted",
        "rejected",
        "reacquired",
        "missed",
        "false",
        "longest_rejection_streak",
        "longest_rejection_streak_s",
        "ends_denied",
    ];
    columns
        .iter()
        .try_for_each(|column| cells.put(format_args!("{}_{column}", s.name)))?;
    for what in ["rms", "max"] {
        let mut rows = 1..=s.innovations.unit.len();
        rows.try_for_each(|k| cells.put(format_args!("{}_innovation_{what}_{k}", s.name)))?;
    }
    Ok(())
}

/// The cells of a sensor in runs.csv.
fn sensor_cells(cells: &mut Cells<impl Write>, s: &SensorStatistics) -> io::Result<()> {
    real(cells, s.nis.map_or(f64::NAN, |nis| nis.mean))?;
    [s.accepted, s.rejected, s.reacquired]
        .into_iter()
        .try_for_each(|count| cells.put(count))?;
    cells.maybe(s.disturbed.map(|d| d.missed))?;
    cells.maybe(s.disturbed.map(|d| d.false_rejections))?;
    let (measurements, seconds) = s.longest_rejection_streak.map_or((0, 0.0), |r| (r.measurements, r.seconds));
    cells.put(measurements)?;
    real(cells, seconds)?;
    cells.put(u8::from(s.ends_denied))?;
    let innovations = &s.innovations;
    let known = |value: f64| if innovations.count > 0 { value } else { f64::NAN };
    let mut values = innovations.rms.iter().chain(&innovations.max);
    values.try_for_each(|value| real(cells, known(*value)))
}
