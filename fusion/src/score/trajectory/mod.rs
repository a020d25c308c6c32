//! Absolute and relative trajectory errors (ATE, RPE), as the tool *evo* defines them.
//!
//! With P_k the poses of the estimate and Q_k those of the reference at the same instants, in Cartesian axes:
//!
//! ATE   S of least squares over the positions; errors |S p_k − q_k| \[m\] and ∠(Q_k⁻¹ S P_k)
//! RPE   over pairs (i, j) a distance apart on the way of the estimate: E = (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j),
//!       errors |trans E| \[m\] and ∠E; of positions alone |S (p_j − p_i) − (q_j − q_i)|, S without its translation
//!
//! With attitudes, E does not depend on the axes of either trajectory. Displacements alone do: they are compared after
//! the displayed alignment.
//!
//! Axes     north-east-down, tangent to the Earth at the first position of the reference
//! Kept     every pose up to 2^16, then every second, fourth, …
//! Not here a change of scale
//! Source   Sturm et al. 2012 (RPE); Umeyama 1991 (S); github.com/MichaelGrupp/evo 1.38, `evo_ape`, `evo_rpe`

mod alignment;
mod relative;
mod statistics;
#[cfg(test)]
mod tests;

pub use alignment::Alignment;
pub use relative::Pairs;
pub use statistics::Statistics;

use super::bounded::Thinned;
use super::comparison::EpochError;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::time::Time;
use fusion_models::earth::frames::{LocalFrame, rotation_en};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use relative::steps;
use schemars::JsonSchema;
use serde::Serialize;

/// Without declared distances: the largest powers of ten that fit this often into the path, and how many of them are
/// used.
const OFTEN: f64 = 5.0;
const DISTANCES: usize = 2;

/// The rules for comparing trajectories.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrajectoryRules {
    /// The displayed alignment; the score contains all of them.
    pub align: Alignment,
    /// Distances of the relative errors \[m\]; if empty, the length of the path decides.
    pub distances: Vec<f64>,
    /// The pairs of poses to compare.
    pub pairs: Pairs,
}

/// Absolute and relative errors of a trajectory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Trajectory {
    /// Poses compared.
    pub poses: usize,
    /// The poses with an attitude. They give the rotations, and also the relative errors if there are any.
    pub attitudes: usize,
    /// True if the reference has no height: then the height of the estimate is used for both.
    pub horizontal: bool,
    /// Length of the path of the reference \[m\].
    pub length: f64,
    /// The displayed alignment.
    pub shown: Alignment,
    /// For each alignment that the positions determine.
    pub absolute: Vec<AbsoluteError>,
    /// For each distance that fits into the path.
    pub relative: Vec<RelativeError>,
}

/// Absolute trajectory error after an alignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct AbsoluteError {
    /// The alignment used.
    pub align: Alignment,
    /// Length of the position error \[m\].
    pub position: Statistics,
    /// Angle between the attitudes \[deg\].
    pub rotation_deg: Option<Statistics>,
}

/// Relative pose error over a distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RelativeError {
    /// The distance \[m\].
    pub distance: f64,
    /// Length of the translation error \[m\].
    pub position: Statistics,
    /// Angle of the rotation error \[deg\].
    pub rotation_deg: Option<Statistics>,
}

/// A position and an attitude in Cartesian axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, north east down \[m\].
    pub position: Vector3<f64>,
    /// From body to these axes; `None` if the reference has none.
    pub attitude: Option<UnitQuaternion<f64>>,
}

/// The poses of estimate and reference at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePair {
    /// The instant.
    pub time: Time,
    /// The pose of the reference's point and of its body, apart from a mounting.
    pub estimate: Pose,
    /// The reference.
    pub reference: Pose,
}

/// The known positions and attitudes of estimate and reference at an instant.
#[derive(Clone, Copy, Debug, Default)]
struct Instant {
    time: Time,
    places: Option<[Geodetic; 2]>,
    attitudes: Option<[UnitQuaternion<f64>; 2]>,
}

/// Collects poses during a run.
#[derive(Clone, Debug, Default)]
pub struct Poses {
    /// Several epochs of the same time make one pose: position and attitude may come from different references.
    last: Instant,
    kept: Thinned<Instant>,
    horizontal: bool,
}

fusion_core::memory!(Instant { time, places, attitudes });
fusion_core::memory!(Poses { last, kept, horizontal });

impl Poses {
    /// Takes the error at the next epoch of the reference.
    pub fn add(&mut self, error: &EpochError) {
        if error.time() != self.last.time {
            self.keep();
            self.last.time = error.time();
        }
        if error.position.is_some_and(|d| d.is_horizontal()) {
            self.last.places = error.places;
            self.horizontal |= error.position.is_some_and(|d| !d.is_whole());
        }
        if let Some(a) = &error.attitude {
            self.last.attitudes = Some([a.estimate, a.truth]);
        }
    }

    fn keep(&mut self) {
        let last = core::mem::take(&mut self.last);
        if last.places.is_some() {
            self.kept.push(last);
        }
    }

    /// Both trajectories; `mounting` is the rotation from body to the reference's body.
    #[must_use]
    pub fn pairs(&mut self, mounting: &UnitQuaternion<f64>) -> Vec<PosePair> {
        self.keep();
        let rows = self.kept.rows();
        let Some([_, first]) = rows.first().and_then(|row| row.places) else {
            return Vec::new();
        };
        let (frame, to_local) = (LocalFrame::new(first), rotation_en(first.lat, first.lon).transpose());
        let pose = |place: &Geodetic, attitude: Option<UnitQuaternion<f64>>| {
            let turned = |q| {
                let c = to_local * rotation_en(place.lat, place.lon);
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(c)) * q
            };
            Pose {
                position: frame.to_ned(place),
                attitude: attitude.map(turned),
            }
        };
        let of = |row: &Instant| {
            let ([estimated, place], attitudes) = (row.places?, row.attitudes);
            Some(PosePair {
                time: row.time,
                estimate: pose(&estimated, attitudes.map(|[q, _]| q * mounting)),
                reference: pose(&place, attitudes.map(|[_, q]| q)),
            })
        };
        rows.iter().filter_map(of).collect()
    }

    /// The errors of the trajectory; `None` for fewer than two poses.
    #[must_use]
    pub fn finish(mut self, rules: &TrajectoryRules, mounting: &UnitQuaternion<f64>) -> Option<Trajectory> {
        let pairs = self.pairs(mounting);
        (pairs.len() >= 2).then(|| Trajectory::of(&pairs, rules, self.horizontal))
    }
}

impl Trajectory {
    /// For poses in order of time; `horizontal` if the reference poses have the heights of the estimate.
    #[must_use]
    pub fn of(pairs: &[PosePair], rules: &TrajectoryRules, horizontal: bool) -> Self {
        let length = steps(pairs, |pair| &pair.reference).iter().sum();
        let with_attitude: Vec<PosePair> = pairs.iter().filter(|pair| pair.rotation().is_some()).copied().collect();
        let related = if with_attitude.is_empty() { pairs } else { &with_attitude };
        let distances = if rules.distances.is_empty() {
            usual_distances(length)
        } else {
            rules.distances.clone()
        };
        let absolute = |align: &Alignment| AbsoluteError::of(pairs, *align);
        let motion = rules.align.of(pairs).filter(|_| with_attitude.is_empty());
        let aligned: Vec<PosePair> = related.iter().map(|pair| motion.map_or(*pair, |m| m.aligned(pair))).collect();
        let alignments = Alignment::ALL.iter().filter(|align| !(horizontal && **align == Alignment::Se3));
        Self {
            poses: pairs.len(),
            attitudes: with_attitude.len(),
            horizontal,
            length,
            shown: rules.align,
            absolute: alignments.filter_map(absolute).collect(),
            relative: distances
                .into_iter()
                .filter_map(|distance| RelativeError::of(&aligned, distance, rules.pairs))
                .collect(),
        }
    }
}

/// The largest powers of ten \[m\] that fit often enough into a path of this length, in order.
fn usual_distances(length: f64) -> Vec<f64> {
    let powers = [1.0, 10.0, 100.0, 1e3, 1e4, 1e5];
    let held: Vec<f64> = powers.into_iter().filter(|power| OFTEN * power <= length).collect();
    held[held.len().saturating_sub(DISTANCES)..].to_vec()
}

impl PosePair {
    /// The rotation between the two attitudes.
    fn rotation(&self) -> Option<UnitQuaternion<f64>> {
        Some(self.reference.attitude?.inverse() * self.estimate.attitude?)
    }
}

/// The angle of a rotation \[deg\].
fn degrees(q: &UnitQuaternion<f64>) -> f64 {
    so3::log(q).norm().to_degrees()
}

impl AbsoluteError {
    /// `None` if the positions do not determine the alignment.
    fn of(pairs: &[PosePair], align: Alignment) -> Option<Self> {
        let motion = align.of(pairs)?;
        let distance = |pair: &PosePair| (pair.estimate.position - pair.reference.position).norm();
        let aligned: Vec<PosePair> = pairs.iter().map(|pair| motion.aligned(pair)).collect();
        let angles = aligned.iter().filter_map(PosePair::rotation).map(|q| degrees(&q));
        Some(Self {
            align,
            position: Statistics::of(aligned.iter().map(distance))?,
            rotation_deg: Statistics::of(angles),
        })
    }
}

impl RelativeError {
    /// `None` if no two poses are this far apart.
    fn of(pairs: &[PosePair], distance: f64, which: Pairs) -> Option<Self> {
        let chosen = which.apart(&steps(pairs, |pair| &pair.estimate), distance);
        let errors = chosen.iter().map(|[from, to]| relative::error(&pairs[*from], &pairs[*to]));
        let (translations, rotations): (Vec<f64>, Vec<Option<f64>>) = errors.unzip();
        Some(Self {
            distance,
            position: Statistics::of(translations.into_iter())?,
            rotation_deg: Statistics::of(rotations.into_iter().flatten()),
        })
    }
}
