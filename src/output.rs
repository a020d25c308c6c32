//! What a run writes: estimates.csv, updates.csv, summary.json.

use crate::solution::{Solution, sigmas};
use fusion_core::filter::{Update, Verdict};
use fusion_core::gate::Mode;
use fusion_core::state::{Belief, Block, Kind, Layout};
use fusion_core::time::Time;
use fusion_models::earth::LocalFrame;
use fusion_models::vocabulary::state;
use nalgebra::Vector3;
use std::io::{self, Write};

/// Columns of the navigation solution, in order; the 1σ of each follows with `sigma_` before it.
const SOLUTION: [&str; 12] = [
    "lat_deg",
    "lon_deg",
    "height_m",
    "n_m",
    "e_m",
    "d_m",
    "vn_mps",
    "ve_mps",
    "vd_mps",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];

/// Blocks that the solution's columns already show.
const SHOWN: [&str; 4] = [
    state::POSITION.as_str(),
    state::VELOCITY.as_str(),
    state::ATTITUDE.as_str(),
    state::LOCAL_POSITION.as_str(),
];

/// Names of a block's axes as they end its columns.
fn axes(kind: Kind) -> Vec<String> {
    match kind {
        Kind::Scalar | Kind::Angle => vec![String::new()],
        Kind::Attitude => ["_roll", "_pitch", "_yaw"].map(str::to_owned).to_vec(),
        Kind::Geodetic => ["_lat", "_lon", "_height"].map(str::to_owned).to_vec(),
        Kind::Position | Kind::Velocity | Kind::Vector(3) => ["_x", "_y", "_z"].map(str::to_owned).to_vec(),
        Kind::Vector(n) => (0..n).map(|i| format!("_{i}")).collect(),
    }
}

/// Writes estimates.csv: time, solution, its 1σ, then every further state with its 1σ, in SI.
#[derive(Debug)]
pub struct EstimateWriter<W> {
    out: W,
    frame: Option<LocalFrame>,
    further: Vec<Block>,
    line: Vec<u8>,
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header. Without an `origin` the first position becomes it.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn new(mut out: W, layout: &Layout, origin: Option<LocalFrame>) -> io::Result<Self> {
        let further: Vec<Block> = layout
            .blocks()
            .iter()
            .filter(|b| !SHOWN.contains(&b.name.as_str()))
            .cloned()
            .collect();
        write!(out, "t_s")?;
        for name in SOLUTION {
            write!(out, ",{name}")?;
        }
        for name in SOLUTION {
            write!(out, ",sigma_{name}")?;
        }
        for block in &further {
            for axis in axes(block.kind) {
                write!(out, ",{}{axis}", block.name)?;
            }
            for axis in axes(block.kind) {
                write!(out, ",sigma_{}{axis}", block.name)?;
            }
        }
        writeln!(out)?;
        Ok(Self {
            out,
            frame: origin,
            further,
            line: Vec::with_capacity(512),
        })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn write(&mut self, s: &Solution, belief: &Belief) -> io::Result<()> {
        self.line.clear();
        let l = &mut self.line;
        write!(l, "{:.6}", s.time.seconds())?;
        let mut sigma = [None; 12];
        if let Some((place, p)) = s.position {
            let frame = *self.frame.get_or_insert_with(|| LocalFrame::new(place));
            let ned = frame.to_ned(&place);
            write!(
                l,
                ",{:.10},{:.10},{:.4}",
                place.lat.to_degrees(),
                place.lon.to_degrees(),
                place.height
            )?;
            write!(l, ",{:.4},{:.4},{:.4}", ned.x, ned.y, ned.z)?;
            let metres = sigmas(&p);
            let (north, east) = place.metres_per_radian();
            sigma[0] = Some((metres.x / north).to_degrees());
            sigma[1] = Some((metres.y / east).to_degrees());
            sigma[2] = Some(metres.z);
            set3(&mut sigma[3..], &metres);
        } else {
            l.extend_from_slice(b",,,,,,");
        }
        if let Some((v, p)) = s.velocity {
            write!(l, ",{:.5},{:.5},{:.5}", v.x, v.y, v.z)?;
            set3(&mut sigma[6..], &sigmas(&p));
        } else {
            l.extend_from_slice(b",,,");
        }
        if let Some((rpy, spread)) = s.rpy() {
            let rpy = rpy.map(f64::to_degrees);
            write!(l, ",{:.6},{:.6},{:.6}", rpy.x, rpy.y, rpy.z)?;
            set3(&mut sigma[9..], &spread.map(f64::to_degrees));
        } else {
            l.extend_from_slice(b",,,");
        }
        for (i, value) in sigma.iter().enumerate() {
            match value {
                Some(v) if i < 2 => write!(l, ",{v:.3e}")?,
                Some(v) => write!(l, ",{v:.6}")?,
                None => l.push(b','),
            }
        }
        for block in &self.further {
            for value in &belief.x[block.storage_range()][..block.kind.storage()] {
                if block.kind != Kind::Attitude {
                    write!(l, ",{value:.8e}")?;
                }
            }
            if block.kind == Kind::Attitude {
                use fusion_core::state::{Attitude, Manifold};
                let rpy = fusion_core::geometry::so3::to_rpy(&Attitude::read(&belief.x[block.storage_range()]));
                write!(l, ",{:.8e},{:.8e},{:.8e}", rpy.x, rpy.y, rpy.z)?;
            }
            for i in block.tangent_range() {
                write!(l, ",{:.4e}", belief.covariance.sigma(i))?;
            }
        }
        l.push(b'\n');
        self.out.write_all(l)
    }

    /// Flushes.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn set3(out: &mut [Option<f64>], v: &Vector3<f64>) {
    for (o, v) in out.iter_mut().zip(v.iter()) {
        *o = Some(*v);
    }
}

/// Writes updates.csv: one row per measurement.
#[derive(Debug)]
pub struct UpdateWriter<W> {
    out: W,
    rows: usize,
}

impl<W: Write> UpdateWriter<W> {
    /// Writes the header for residuals of up to `rows` numbers.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn new(mut out: W, rows: usize) -> io::Result<Self> {
        write!(out, "t_s,sensor,verdict,nis,statistic,threshold,mode,weight")?;
        for i in 0..rows {
            write!(out, ",residual_{i}")?;
        }
        for i in 0..rows {
            write!(out, ",sigma_{i}")?;
        }
        writeln!(out)?;
        Ok(Self { out, rows })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn write(&mut self, time: Time, sensor: &str, u: &Update<'_>) -> io::Result<()> {
        let mode = if u.mode == Mode::Track { "track" } else { "denied" };
        write!(self.out, "{:.6},{sensor},{}", time.seconds(), verdict_name(u.verdict))?;
        for value in [u.nis, u.statistic, u.threshold] {
            number(&mut self.out, value)?;
        }
        write!(self.out, ",{mode}")?;
        number(&mut self.out, u.weight)?;
        for values in [u.residual, u.innovation_sigma] {
            for i in 0..self.rows {
                number(&mut self.out, values.get(i).copied().unwrap_or(f64::NAN))?;
            }
        }
        writeln!(self.out)
    }

    /// Flushes.
    ///
    /// # Errors
    /// What the writer reports.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// A number, or an empty cell where there is none.
fn number(out: &mut impl Write, value: f64) -> io::Result<()> {
    if value.is_nan() {
        write!(out, ",")
    } else {
        write!(out, ",{value:.6e}")
    }
}

/// The verdict as updates.csv and the summary spell it.
#[must_use]
pub const fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Accepted => "accepted",
        Verdict::Rejected => "rejected",
        Verdict::Readopted => "readopted",
        Verdict::Undefined(_) => "undefined",
        Verdict::Unusable => "unusable",
    }
}
