//! Many runs: variants side by side, and Monte Carlo over seeds.

use crate::config::{Diagnostic, Diagnostics};
use crate::design::Design;
use crate::output::Cells;
use crate::run::{Options, Summary, run};
use crate::score::{Consistency, Score};
use crate::table::{Table, count_cell, number};
use crate::tally::{Count, Innovations, SensorTally, counts, residual_rows};
use fusion_core::consistency::mean_band;
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Several runs on the same data and seeds, side by side.
#[derive(Debug, Default)]
pub struct Comparison {
    /// Name and result of each.
    pub runs: Vec<(String, Summary)>,
}

/// RMS and maximum per axis, drift, what the gates did, consistency and time per epoch.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scores: Vec<Score> = self.runs.iter().map(|(_, s)| s.score.clone().unwrap_or_default()).collect();
        let drifts = scores.iter().any(|s| s.drift_rms.is_some());
        let titles = ["", ">RMS N [m]", ">E", ">D", ">max N [m]", ">E", ">D", ">drift [m]"];
        let mut positions = Table::new(&titles[..titles.len() - usize::from(!drifts)]);
        let mut attitudes = Table::new(&["", ">RMS roll [deg]", ">pitch", ">yaw", ">heading", ">inclination"]);
        let counts = counts(self.runs.iter().flat_map(|(_, summary)| &summary.sensors));
        let mut measurements = count_table(&counts, &[]);
        let mut health = Table::new(&["", ">NEES position", ">velocity", ">attitude", ">ns per epoch"]);
        for ((name, summary), score) in self.runs.iter().zip(&scores) {
            let cells = |values: Vec<f64>| values.into_iter().map(number).collect::<Vec<_>>();
            let row = |cells: Vec<String>| [name.clone()].into_iter().chain(cells);
            let mut position = score.position.map_or_else(Vec::new, |a| cells([a.rms, a.max].concat()));
            position.resize(6, String::new());
            position.extend(drifts.then(|| score.drift_rms.map_or_else(String::new, number)));
            positions.row(row(position));
            let mut attitude = score.attitude_deg.map_or_else(Vec::new, |a| cells(a.rms.to_vec()));
            attitude.extend(score.heading_rmse_deg.into_iter().chain(score.inclination_rmse_deg).map(number));
            attitude.resize(5, String::new());
            attitudes.row(row(attitude));
            measurements.row(row(counts.iter().map(|(_, count)| sum(&summary.sensors, *count)).collect()));
            let nees = |c: Option<Consistency>| c.map_or_else(String::new, |c| format!("{} {}", number(c.mean), c.word()));
            let mut judged = [score.nees_position, score.nees_velocity, score.nees_attitude].map(nees).to_vec();
            judged.push(format!("{:.0}", summary.filter_ns_per_epoch));
            health.row(row(judged));
        }
        if scores.iter().any(|s| s.position.is_some()) {
            let drift = if drifts { "; drift is the RMS over declared outages" } else { "" };
            writeln!(f, "Position against the reference{drift}\n{positions}")?;
        }
        if scores.iter().any(|s| s.attitude_deg.is_some()) {
            writeln!(f, "Attitude against the reference\n{attitudes}")?;
        }
        writeln!(f, "Measurements of all sensors together\n{measurements}")?;
        writeln!(f, "Consistency (3 is expected), time\n{health}")
    }
}

/// A table of counts, with `further` columns after them.
fn count_table(counts: &[(&str, Count)], further: &[&str]) -> Table {
    let counts: Vec<String> = counts.iter().map(|(title, _)| format!(">{title}")).collect();
    let titles = [""].into_iter().chain(counts.iter().map(String::as_str));
    Table::new(&titles.chain(further.iter().copied()).collect::<Vec<_>>())
}

/// The sum over `sensors`, empty where it is known of none of them.
fn sum<'a>(sensors: impl IntoIterator<Item = &'a SensorTally>, count: Count) -> String {
    count_cell(sensors.into_iter().filter_map(count).reduce(|a, b| a + b))
}

/// What is kept of one Monte Carlo run. No timing, so that it is a function of its seed.
#[derive(Clone, Debug, Serialize)]
pub struct RunRow {
    /// Its number.
    pub run: u64,
    /// Its seed.
    pub seed: u64,
    /// Position error RMS, north east down \[m\].
    pub rms: [f64; 3],
    /// Largest position error, north east down \[m\].
    pub max: [f64; 3],
    /// Velocity error RMS \[m/s\].
    pub velocity_rms: [f64; 3],
    /// Attitude error RMS, roll pitch yaw \[deg\].
    pub attitude_rms: [f64; 3],
    /// NEES of position, velocity, attitude.
    pub nees: [Option<Consistency>; 3],
    /// What became of the measurements of each sensor.
    pub sensors: Vec<SensorTally>,
}

impl RunRow {
    fn new(run: u64, seed: u64, summary: &Summary) -> Self {
        let score = summary.score.clone().unwrap_or_default();
        let axes = |a: Option<crate::score::Axes>| a.unwrap_or_default();
        Self {
            run,
            seed,
            rms: axes(score.position).rms,
            max: axes(score.position).max,
            velocity_rms: axes(score.velocity).rms,
            attitude_rms: axes(score.attitude_deg).rms,
            nees: [score.nees_position, score.nees_velocity, score.nees_attitude],
            sensors: summary.sensors.clone(),
        }
    }
}

/// The result of a Monte Carlo campaign.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// One row per run, in order of their numbers; all of them have the same sensors.
    pub rows: Vec<RunRow>,
}

/// The seed of run number `run`: it depends on nothing else.
#[must_use]
pub fn seed_of(seed: u64, run: u64) -> u64 {
    fusion_models::fault::derive_seed(seed, &["run", &run.to_string()])
}

/// Runs the design `count` times, each with a seed of its own; on `threads` threads, 0 for as
/// many as there are cores. The rows do not depend on the number of threads.
///
/// # Errors
/// What the first failing run reports.
pub fn monte_carlo(
    design: &Design,
    options: &Options,
    count: u64,
    seed: u64,
    threads: usize,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Campaign, Diagnostics> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Diagnostics::from(Diagnostic::error(format!("no threads to run on: {e}"))))?;
    let done = AtomicUsize::new(0);
    let one = |number: u64| -> Result<RunRow, Diagnostics> {
        let seed = seed_of(seed, number);
        let options = Options {
            seed: Some(seed),
            out: None,
            data: options.data.clone(),
            base: options.base.clone(),
        };
        let summary = run(design, &options, &mut |_| {})?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        Ok(RunRow::new(number, seed, &summary))
    };
    let rows: Result<Vec<RunRow>, Diagnostics> = pool.install(|| (0..count).into_par_iter().map(one).collect());
    Ok(Campaign { rows: rows? })
}

/// Whether a mean statistic is what its covariance promised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Honesty {
    /// In its band.
    Consistent,
    /// The errors are larger than the filter believes.
    Optimistic,
    /// The errors are smaller than the filter believes.
    Pessimistic,
}

impl fmt::Display for Honesty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Consistent => "consistent",
            Self::Optimistic => "optimistic",
            Self::Pessimistic => "pessimistic",
        })
    }
}

/// A mean over runs with its band.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// The mean over all runs.
    pub mean: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// The 95 % band of the mean.
    pub band: (f64, f64),
    /// The verdict.
    pub honesty: Honesty,
}

/// Mean, standard deviation, smallest and largest over the runs.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Campaign {
    /// The spread over the runs of some figure of a run; `None` without finite figures.
    #[must_use]
    pub fn spread(&self, figure: impl Fn(&RunRow) -> f64) -> Option<Spread> {
        let values: Vec<f64> = self.rows.iter().map(figure).filter(|v| v.is_finite()).collect();
        let n = values.len() as f64;
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let (min, max) = values.iter().fold((f64::MAX, f64::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        Some(Spread {
            mean,
            std: variance.sqrt(),
            min,
            max,
        })
    }

    /// Judges the mean over the runs of a statistic that each run averages over time.
    ///
    /// The runs are independent, and each carries as many independent samples as its own
    /// [`Consistency`] says: the band is that of a χ² mean over all of them.
    #[must_use]
    pub fn judge(&self, figure: impl Fn(&RunRow) -> Option<Consistency>) -> Option<Judged> {
        let all: Vec<Consistency> = self.rows.iter().filter_map(figure).collect();
        let dof = all.first()?.dof;
        let mean = all.iter().map(|c| c.mean).sum::<f64>() / all.len() as f64;
        let independent = all.iter().map(|c| c.independent).sum::<f64>();
        let band = mean_band(0.95, dof, independent.round() as usize);
        let honesty = if mean > band.1 {
            Honesty::Optimistic
        } else if mean < band.0 {
            Honesty::Pessimistic
        } else {
            Honesty::Consistent
        };
        Some(Judged { mean, dof, band, honesty })
    }

    /// The sensors of every run, as the first one has them.
    fn sensors(&self) -> &[SensorTally] {
        self.rows.first().map_or(&[], |row| &row.sensors)
    }

    /// Writes runs.csv: one row per run and no timing, the same file for any number of threads.
    ///
    /// Innovations are in SI units, per residual row from 1. A cell is empty where there is
    /// nothing to say: `missed` and `false` of a sensor that no declared fault disturbs, say.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn write(&self, out: impl Write) -> io::Result<()> {
        let mut cells = Cells::new(out);
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
        self.sensors().iter().try_for_each(|sensor| sensor_header(&mut cells, sensor))?;
        cells.end()?;
        for row in &self.rows {
            cells.put(row.run)?;
            cells.put(row.seed)?;
            let nees = row.nees.map(|c| c.map_or(f64::NAN, |c| c.mean));
            for values in [row.rms, row.max, row.velocity_rms, row.attitude_rms, nees] {
                values.into_iter().try_for_each(|value| real(&mut cells, value))?;
            }
            row.sensors.iter().try_for_each(|sensor| sensor_cells(&mut cells, sensor))?;
            cells.end()?;
        }
        cells.flush()
    }
}

/// A number, or an empty cell where there is none.
fn real(cells: &mut Cells<impl Write>, value: f64) -> io::Result<()> {
    if value.is_finite() {
        cells.put(format_args!("{value:.9e}"))
    } else {
        cells.text("")
    }
}

/// The columns of a sensor in runs.csv.
fn sensor_header(cells: &mut Cells<impl Write>, s: &SensorTally) -> io::Result<()> {
    let columns = [
        "nis",
        "accepted",
        "rejected",
        "readopted",
        "missed",
        "false",
        "longest_refusal",
        "longest_refusal_s",
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
fn sensor_cells(cells: &mut Cells<impl Write>, s: &SensorTally) -> io::Result<()> {
    real(cells, s.nis.map_or(f64::NAN, |nis| nis.mean))?;
    [s.accepted, s.rejected, s.readopted]
        .into_iter()
        .try_for_each(|count| cells.put(count))?;
    cells.maybe(s.disturbed.map(|d| d.missed))?;
    cells.maybe(s.disturbed.map(|d| d.false_rejections))?;
    let (measurements, seconds) = s.longest_refusal.map_or((0, 0.0), |r| (r.measurements, r.seconds));
    cells.put(measurements)?;
    real(cells, seconds)?;
    cells.put(u8::from(s.ends_denied))?;
    let innovations = &s.innovations;
    let known = |value: f64| if innovations.count > 0 { value } else { f64::NAN };
    let mut values = innovations.rms.iter().chain(&innovations.max);
    values.try_for_each(|value| real(cells, known(*value)))
}

/// The campaign as tables: spreads per axis, consistency with its verdict, what the gates did,
/// innovations.
impl fmt::Display for Campaign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        type Figure = fn(&RunRow) -> [f64; 3];
        let groups: [(&str, Figure, [&str; 3]); 4] = [
            ("position RMS [m]", |r| r.rms, ["north", "east", "down"]),
            ("position max [m]", |r| r.max, ["north", "east", "down"]),
            ("velocity RMS [m/s]", |r| r.velocity_rms, ["north", "east", "down"]),
            ("attitude RMS [deg]", |r| r.attitude_rms, ["roll", "pitch", "yaw"]),
        ];
        let mut errors = Table::new(&["", ">mean", ">std", ">min", ">max"]);
        for (name, figure, axes) in groups {
            for (i, axis) in axes.iter().enumerate() {
                if let Some(s) = self.spread(|r| figure(r)[i]) {
                    errors.row([
                        format!("{name} {axis}"),
                        number(s.mean),
                        number(s.std),
                        number(s.min),
                        number(s.max),
                    ]);
                }
            }
        }
        let mut consistency = Table::new(&["", ">mean", ">dof", ">95 % band", ""]);
        let states = ["position", "velocity", "attitude"];
        let nees = states
            .iter()
            .enumerate()
            .map(|(i, s)| (format!("NEES {s}"), self.judge(|r| r.nees[i])));
        let nis = self
            .sensors()
            .iter()
            .enumerate()
            .map(|(i, s)| (format!("NIS {}", s.name), self.judge(|r| r.sensors[i].nis)));
        for (name, judged) in nees.chain(nis) {
            if let Some(j) = judged {
                let by = match j.honesty {
                    Honesty::Consistent => String::new(),
                    _ => format!(", errors {} × its 1σ", number((j.mean / j.dof as f64).sqrt())),
                };
                let band = format!("{} … {}", number(j.band.0), number(j.band.1));
                consistency.row([name, number(j.mean), j.dof.to_string(), band, format!("{}{by}", j.honesty)]);
            }
        }
        writeln!(f, "{} runs\n\nErrors over the runs\n{errors}", self.rows.len())?;
        writeln!(f, "Consistency\n{consistency}\nSensors\n{}", self.gates())?;
        let innovations = self.innovations();
        if innovations.is_empty() {
            return Ok(());
        }
        writeln!(f, "Innovations of accepted measurements, over the runs\n{innovations}")
    }
}

impl Campaign {
    /// Counts summed over the runs, and the longest refusals.
    fn gates(&self) -> Table {
        let counts = counts(self.rows.iter().flat_map(|row| &row.sensors));
        let refusals = [">longest refusal", ">[s]", ">runs that end denied"];
        let has_refusals = self.rows.iter().flat_map(|row| &row.sensors).any(|s| s.longest_refusal.is_some());
        let mut table = count_table(&counts, if has_refusals { &refusals } else { &[] });
        for (i, sensor) in self.sensors().iter().enumerate() {
            let runs = self.rows.iter().map(|row| &row.sensors[i]);
            let mut cells = vec![sensor.name.clone()];
            cells.extend(counts.iter().map(|(_, count)| sum(runs.clone(), *count)));
            let refusals = runs.clone().filter_map(|s| s.longest_refusal);
            if let Some(most) = refusals.clone().map(|r| r.measurements).max() {
                let longest = refusals.map(|r| r.seconds).fold(0.0, f64::max);
                let denied = runs.filter(|s| s.ends_denied).count();
                cells.extend([most.to_string(), format!("{longest:.1}"), denied.to_string()]);
            }
            table.row(cells);
        }
        table
    }

    /// RMS and maximum of the innovations, over the runs that have any.
    fn innovations(&self) -> Table {
        let mut table = Table::new(&["", ">mean RMS", ">mean max", ">largest max"]);
        for (i, sensor) in self.sensors().iter().enumerate() {
            for (k, (row, factor)) in residual_rows(sensor).into_iter().enumerate() {
                let of = |values: fn(&Innovations) -> &[f64]| {
                    self.spread(|run| {
                        let innovations = &run.sensors[i].innovations;
                        if innovations.count > 0 {
                            values(innovations)[k] * factor
                        } else {
                            f64::NAN
                        }
                    })
                };
                if let (Some(rms), Some(max)) = (of(|n| &n.rms), of(|n| &n.max)) {
                    let label = format!("{} {row}", sensor.name);
                    table.row([label, number(rms.mean), number(max.mean), number(max.max)]);
                }
            }
        }
        table
    }
}
