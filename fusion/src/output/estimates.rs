//! estimates.csv.

use super::Cells;
use crate::solution::{Solution, sigmas};
use fusion_core::belief::Belief;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::memory::{Memory, Tape};
use fusion_core::state::{Attitude, Block, Kind, Layout, Manifold};
use fusion_models::earth::LocalFrame;
use fusion_models::vocabulary::state;
use nalgebra::Vector3;
use std::io::{self, Write};
use std::sync::{Arc, OnceLock};

/// Columns of the navigation solution, in order; the 1σ of each follows with `sigma_` before it.
pub const SOLUTION: [&str; 12] = [
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

/// Names of a block's stored numbers as they end its columns; an attitude is written as its Euler angles.
fn values(kind: Kind) -> Vec<String> {
    match kind {
        Kind::Scalar | Kind::Angle => vec![String::new()],
        Kind::Attitude => ["_roll", "_pitch", "_yaw"].map(str::to_owned).to_vec(),
        Kind::Geodetic => ["_lat", "_lon", "_height"].map(str::to_owned).to_vec(),
        Kind::Position | Kind::Velocity | Kind::Vector(3) => ["_x", "_y", "_z"].map(str::to_owned).to_vec(),
        Kind::Vector(n) => (0..n).map(|i| format!("_{i}")).collect(),
        Kind::Custom(space) if space.labels == [""] => vec![String::new()],
        Kind::Custom(space) => space.labels.iter().map(|label| format!("_{label}")).collect(),
    }
}

/// Names of the axes of its 1σ: those of its values, or the numbers of the axes of a custom manifold.
fn sigmas_of(kind: Kind) -> Vec<String> {
    match kind {
        Kind::Custom(space) if space.axes.len() == 1 => vec![String::new()],
        Kind::Custom(space) => (0..space.axes.len()).map(|k| format!("_{k}")).collect(),
        _ => values(kind),
    }
}

/// Where local coordinates start: as declared, or at the first position that is written. A copy is the same
/// origin, so that several files share it.
#[derive(Clone, Debug, Default)]
pub struct Origin(Arc<OnceLock<LocalFrame>>);

impl Origin {
    /// As declared, if it is.
    #[must_use]
    pub fn new(declared: Option<LocalFrame>) -> Self {
        Self(Arc::new(declared.map_or_else(OnceLock::new, OnceLock::from)))
    }

    fn remember(&self, tape: &mut Tape<'_>) {
        let mut frame = self.0.get().cloned();
        frame.remember(tape);
        if let Some(frame) = frame {
            // An existing frame is the same.
            let _ = self.0.set(frame);
        }
    }

    /// Metres north, east, down from it. The first place is the origin if none is declared.
    #[must_use]
    pub fn to_ned(&self, place: &Geodetic) -> Vector3<f64> {
        self.frame(*place).to_ned(place)
    }

    fn frame(&self, first: Geodetic) -> &LocalFrame {
        self.0.get_or_init(|| LocalFrame::new(first))
    }
}

/// Writes estimates.csv: time, solution, its 1σ, then every further state with its 1σ, in SI.
///
/// A row is the estimate of an epoch after every measurement that is valid at that time was used:
/// where a fix is used, its 1σ is that of the posterior.
#[derive(Debug)]
pub struct EstimateWriter<W: Write> {
    cells: Cells<W>,
    origin: Origin,
    further: Vec<Block>,
}

/// The rows already written are not part of the memory.
impl<W: Write> Memory for EstimateWriter<W> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.origin.remember(tape);
    }
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn new(out: W, layout: &Layout, origin: Origin) -> io::Result<Self> {
        let blocks = layout.blocks().iter();
        let further: Vec<Block> = blocks.filter(|b| !SHOWN.contains(&b.name.as_str())).cloned().collect();
        let mut cells = Cells::new(out);
        cells.text("t_s")?;
        cells.texts(SOLUTION)?;
        SOLUTION.iter().try_for_each(|name| cells.put(format_args!("sigma_{name}")))?;
        for block in &further {
            for (prefix, names) in [("", values(block.kind)), ("sigma_", sigmas_of(block.kind))] {
                let mut names = names.into_iter();
                names.try_for_each(|axis| cells.put(format_args!("{prefix}{}{axis}", block.name)))?;
            }
        }
        cells.end()?;
        // A full disk is reported before the run.
        cells.flush()?;
        Ok(Self { cells, origin, further })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&mut self, s: &Solution, belief: &Belief) -> io::Result<()> {
        self.cells.fixed(s.time.seconds(), 6);
        self.position(s);
        let velocity = s.velocity.as_ref().map(|(v, _)| v);
        let rpy = s.rpy();
        let angles = rpy.map(|(rpy, _)| rpy.map(f64::to_degrees));
        self.axes(velocity, 5);
        self.axes(angles.as_ref(), 6);
        self.position_sigma(s);
        self.axes(s.velocity.as_ref().map(|(_, p)| sigmas(p)).as_ref(), 6);
        self.axes(rpy.map(|(_, spread)| spread.map(f64::to_degrees)).as_ref(), 6);
        self.further(belief);
        self.cells.end()
    }

    /// Three numbers with this number of decimals.
    fn axes(&mut self, numbers: Option<&Vector3<f64>>, decimals: usize) {
        match numbers {
            Some(numbers) => numbers.iter().for_each(|number| self.cells.fixed(*number, decimals)),
            None => self.cells.empty(3),
        }
    }

    /// Latitude, longitude, height, then metres from the origin.
    fn position(&mut self, s: &Solution) {
        let Some((place, _)) = s.position else {
            return self.cells.empty(6);
        };
        self.cells.fixed(place.lat.to_degrees(), 10);
        self.cells.fixed(place.lon.to_degrees(), 10);
        self.cells.fixed(place.height, 4);
        let ned = self.origin.to_ned(&place);
        self.axes(Some(&ned), 4);
    }

    fn position_sigma(&mut self, s: &Solution) {
        let Some((place, p)) = &s.position else {
            return self.cells.empty(6);
        };
        let metres = sigmas(p);
        let (north, east) = place.metres_per_radian();
        self.cells.scientific((metres.x / north).to_degrees(), 3);
        self.cells.scientific((metres.y / east).to_degrees(), 3);
        self.cells.fixed(metres.z, 6);
        self.axes(Some(&metres), 6);
    }

    /// The states that the solution does not show, each with its 1σ.
    fn further(&mut self, belief: &Belief) {
        for block in &self.further {
            let values = &belief.x[block.storage_range()];
            if block.kind == Kind::Attitude {
                let rpy = so3::to_rpy(&Attitude::read(values));
                rpy.iter().for_each(|angle| self.cells.scientific(*angle, 8));
            } else {
                values.iter().for_each(|value| self.cells.scientific(*value, 8));
            }
            for sigma in belief.covariance.sigmas(block) {
                self.cells.scientific(sigma, 4);
            }
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
