//! estimates.csv.

use super::{Cells, decimal};
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

/// How a text shows the number of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// With this number of decimals.
    Fixed(usize),
    /// The same, in degrees: the number is in radians.
    Degrees(usize),
    /// In degrees, with one digit before the point, this number of decimals, and an exponent of ten.
    ScientificDegrees(usize),
    /// With one digit before the point, this number of decimals, and an exponent of ten.
    Scientific(usize),
}

impl Digits {
    /// The number that a text has for `value`; NaN if the text has none.
    #[must_use]
    pub fn rounded(self, value: f64) -> f64 {
        let mut text = Vec::new();
        self.write(value, &mut text);
        let parsed = core::str::from_utf8(&text).ok().and_then(|text| text.parse().ok());
        parsed.unwrap_or(f64::NAN)
    }

    pub(super) fn write(self, value: f64, text: &mut Vec<u8>) {
        match self {
            Self::Fixed(decimals) => decimal::fixed(text, value, decimals),
            Self::Degrees(decimals) => decimal::fixed(text, value.to_degrees(), decimals),
            Self::ScientificDegrees(decimals) => decimal::scientific(text, value.to_degrees(), decimals),
            Self::Scientific(decimals) => decimal::scientific(text, value, decimals),
        }
    }
}

/// Takes the cells of a row, one after the other.
pub trait EstimateCells {
    /// A number in SI, an angle in radians, and how a text shows it.
    fn number(&mut self, value: f64, digits: Digits);

    /// This number of cells without a value.
    fn empty(&mut self, cells: usize);
}

/// The columns of estimates.csv: time, solution, its 1σ, then every further state with its 1σ.
///
/// A row is the estimate of an epoch after every measurement that is valid at that time was used:
/// where a fix is used, its 1σ is that of the posterior.
#[derive(Clone, Debug)]
pub struct EstimateColumns {
    origin: Origin,
    further: Vec<Block>,
}

/// The origin may be the first place.
impl Memory for EstimateColumns {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.origin.remember(tape);
    }
}

impl EstimateColumns {
    /// The columns for the states of a layout.
    #[must_use]
    pub fn new(layout: &Layout, origin: Origin) -> Self {
        let blocks = layout.blocks().iter();
        let further = blocks.filter(|b| !SHOWN.contains(&b.name.as_str())).cloned().collect();
        Self { origin, further }
    }

    /// Their names, in order.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        let mut names = vec!["t_s".to_owned()];
        names.extend(SOLUTION.map(str::to_owned));
        names.extend(SOLUTION.map(|name| format!("sigma_{name}")));
        for block in &self.further {
            names.extend(values(block.kind).into_iter().map(|axis| format!("{}{axis}", block.name)));
            let sigmas = sigmas_of(block.kind).into_iter();
            names.extend(sigmas.map(|axis| format!("sigma_{}{axis}", block.name)));
        }
        names
    }

    /// The states behind the solution: the name of each, its number of values and its number of 1σ.
    pub fn further(&self) -> impl Iterator<Item = (&str, usize, usize)> {
        let counted = |block: &Block| (values(block.kind).len(), sigmas_of(block.kind).len());
        self.further.iter().map(move |block| {
            let (values, sigmas) = counted(block);
            (block.name.as_str(), values, sigmas)
        })
    }

    /// Passes the cells of one row.
    pub fn write(&self, s: &Solution, belief: &Belief, to: &mut impl EstimateCells) {
        to.number(s.time.seconds(), Digits::Fixed(6));
        self.position(s, to);
        let velocity = s.velocity.as_ref().map(|(v, _)| v);
        let rpy = s.rpy();
        axes(velocity, Digits::Fixed(5), to);
        axes(rpy.as_ref().map(|(rpy, _)| rpy), Digits::Degrees(6), to);
        position_sigma(s, to);
        axes(s.velocity.as_ref().map(|(_, p)| sigmas(p)).as_ref(), Digits::Fixed(6), to);
        axes(rpy.as_ref().map(|(_, spread)| spread), Digits::Degrees(6), to);
        self.states(belief, to);
    }

    /// Latitude, longitude, height, then metres from the origin.
    fn position(&self, s: &Solution, to: &mut impl EstimateCells) {
        let Some((place, _)) = s.position else {
            return to.empty(6);
        };
        to.number(place.lat, Digits::Degrees(10));
        to.number(place.lon, Digits::Degrees(10));
        to.number(place.height, Digits::Fixed(4));
        axes(Some(&self.origin.to_ned(&place)), Digits::Fixed(4), to);
    }

    /// The states that the solution does not show, each with its 1σ.
    fn states(&self, belief: &Belief, to: &mut impl EstimateCells) {
        for block in &self.further {
            let values = &belief.x[block.storage_range()];
            if block.kind == Kind::Attitude {
                axes(Some(&so3::to_rpy(&Attitude::read(values))), Digits::Scientific(8), to);
            } else {
                values.iter().for_each(|value| to.number(*value, Digits::Scientific(8)));
            }
            for sigma in belief.covariance.sigmas(block) {
                to.number(sigma, Digits::Scientific(4));
            }
        }
    }
}

fn axes(numbers: Option<&Vector3<f64>>, digits: Digits, to: &mut impl EstimateCells) {
    match numbers {
        Some(numbers) => numbers.iter().for_each(|number| to.number(*number, digits)),
        None => to.empty(3),
    }
}

fn position_sigma(s: &Solution, to: &mut impl EstimateCells) {
    let Some((place, p)) = &s.position else {
        return to.empty(6);
    };
    let metres = sigmas(p);
    let (north, east) = place.metres_per_radian();
    to.number(metres.x / north, Digits::ScientificDegrees(3));
    to.number(metres.y / east, Digits::ScientificDegrees(3));
    to.number(metres.z, Digits::Fixed(6));
    axes(Some(&metres), Digits::Fixed(6), to);
}

/// Writes estimates.csv, with [`EstimateColumns`].
#[derive(Debug)]
pub struct EstimateWriter<W: Write> {
    cells: Cells<W>,
    columns: EstimateColumns,
}

/// The rows already written are not part of the memory.
impl<W: Write> Memory for EstimateWriter<W> {
    fn remember(&mut self, tape: &mut Tape<'_>) {
        self.columns.remember(tape);
    }
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn new(out: W, layout: &Layout, origin: Origin) -> io::Result<Self> {
        let columns = EstimateColumns::new(layout, origin);
        let mut cells = Cells::new(out);
        columns.names().iter().try_for_each(|name| cells.text(name))?;
        cells.end()?;
        // A full disk is reported before the run.
        cells.flush()?;
        Ok(Self { cells, columns })
    }

    /// Writes one row.
    ///
    /// # Errors
    /// The errors of the writer.
    pub fn write(&mut self, s: &Solution, belief: &Belief) -> io::Result<()> {
        self.columns.write(s, belief, &mut self.cells);
        self.cells.end()
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
