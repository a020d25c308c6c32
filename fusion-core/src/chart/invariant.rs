//! Invariant charts: the error is an element of the group of extended poses.
//!
//! Group     χ = (C, v, p) in SE₂(3): C = C_nb, v velocity, p position from an origin, navigation
//!           axes. Without velocity SE(3), without both SO(3). A heading in place of an attitude is a turn
//!           about down: SE(2) in the horizontal plane.
//! Exp       Exp(φ, ν, ρ) = (Exp φ, J_l(φ)ν, J_l(φ)ρ)
//! Right     χ = Exp(ξ) χ̂:  C = Exp(φ)Ĉ, u = Exp(φ)û + J_l ν, u any of v, p
//!           T: δφ_b = Ĉᵀφ, δu = ν − û × φ
//! Left      χ = χ̂ Exp(ξ):  C = Ĉ Exp(φ), u = û + Ĉ J_l ν
//!           T: δφ_b = φ, δu = Ĉν
//! Others    every other block keeps its own error: the imperfect extension. Or, vectors in body
//!           axes b (biases) in the two-frames group, (C₁, …, b₁)(C₂, …, b₂) = (C₁C₂, …, b₂ + C₂ᵀb₁):
//!           right b = b̂ + ĈᵀJ_r ζ, left b = Exp(φ)ᵀb̂ + J_r ζ
//! Geodetic  p = −(origin ⊟ x), in metres north, east, down at x; p ⊞ δp by the block itself. First
//!           order in the distance over the radius of the Earth, like every sum of such metres
//! Source    Barrau and Bonnabel 2017 (IEEE TAC 62(4)); Brossard, Barrau, Bonnabel 2022 (arXiv
//!           2007.14097) for the extended Jacobians; Barrau and Bonnabel 2022 (arXiv 2201.04426) for two frames

use super::{Chart, Reset, correct_block};
use crate::geometry::so3;
use crate::geometry::wgs84::Geodetic;
use crate::linear::BlockMatrix;
use crate::state::{Angle, Attitude, Block, Kind, Layout, Manifold, StateRole};
use alloc::sync::Arc;
use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

/// On which side of the estimate the error stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// χ = Exp(ξ) χ̂.
    Right,
    /// χ = χ̂ Exp(ξ).
    Left,
}

/// How the chart treats vectors in body axes, such as the biases of inertial sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Biases {
    /// Their errors stay outside the group: the imperfect extension.
    #[default]
    Imperfect,
    /// They belong to the group: the two-frames group.
    TwoFrames,
}

/// An invariant chart.
#[derive(Clone, Copy, Debug)]
pub struct Invariant {
    /// On which side of the estimate the error stands.
    pub side: Side,
    /// Whether biases belong to the group.
    pub biases: Biases,
    /// The origin of a geodetic position in the group; if `None`, the place where the filter starts. A Cartesian
    /// position has its own origin. The left-invariant chart needs no origin.
    pub origin: Option<Geodetic>,
}

/// The block that turns.
#[derive(Clone, Copy, Debug)]
enum Turning<'a> {
    Attitude(&'a Block),
    Heading(&'a Block),
}

impl<'a> Turning<'a> {
    fn of(layout: &'a Layout) -> Option<Self> {
        let attitude = kinematic(layout, |k| k == Kind::Attitude).map(Turning::Attitude);
        attitude.or_else(|| kinematic(layout, |k| k == Kind::Angle).map(Turning::Heading))
    }

    const fn block(&self) -> &'a Block {
        let (Self::Attitude(block) | Self::Heading(block)) = self;
        block
    }

    fn read(&self, x: &[f64]) -> UnitQuaternion<f64> {
        let storage = &x[self.block().storage_range()];
        match self {
            Self::Attitude(_) => Attitude::read(storage),
            Self::Heading(_) => so3::exp(&(Vector3::z() * Angle::read(storage))),
        }
    }

    /// The turn of the tangent coordinates `delta`, in body axes.
    fn turn(&self, delta: &[f64]) -> Vector3<f64> {
        let d = &delta[self.block().tangent_range()];
        match self {
            Self::Attitude(_) => Vector3::from_column_slice(d),
            Self::Heading(_) => Vector3::new(0.0, 0.0, d[0]),
        }
    }

    fn set_turn(&self, turn: &Vector3<f64>, delta: &mut [f64]) {
        let d = &mut delta[self.block().tangent_range()];
        match self {
            Self::Attitude(_) => d.copy_from_slice(turn.as_slice()),
            Self::Heading(_) => d[0] = turn.z,
        }
    }

    /// Sets the block of `m` of which the rows lie at `row` and the columns are this block's.
    fn set_column(&self, m: &mut BlockMatrix, row: usize, by_turn: &Matrix3<f64>) {
        let column = self.block().tangent;
        match self {
            Self::Attitude(_) => m.set_at(row, column, by_turn),
            Self::Heading(_) => m.set_at(row, column, &by_turn.fixed_columns::<1>(2).into_owned()),
        }
    }

    /// Sets the block of `m` on the diagonal. A heading turns about one axis: its one stays.
    fn set_diagonal(&self, m: &mut BlockMatrix, value: &Matrix3<f64>) {
        if let Self::Attitude(block) = self {
            m.set_at(block.tangent, block.tangent, value);
        }
    }
}

fn kinematic(layout: &Layout, is: impl Fn(Kind) -> bool) -> Option<&Block> {
    layout.blocks().iter().find(|b| b.role == StateRole::Kinematic && is(b.kind))
}

/// A velocity or a position, as it belongs to the group.
#[derive(Clone, Copy, Debug)]
struct Moved<'a> {
    block: &'a Block,
    /// û: navigation axes, a position from the origin.
    value: Vector3<f64>,
}

/// Row and column of a 3×3 block of the tangent space.
fn at(m: &mut BlockMatrix, row: &Block, column: &Block, value: &SMatrix<f64, 3, 3>) {
    m.set_at(row.tangent, column.tangent, value);
}

impl Invariant {
    /// The right-invariant chart, biases outside the group.
    #[must_use]
    pub const fn right() -> Self {
        Self {
            side: Side::Right,
            biases: Biases::Imperfect,
            origin: None,
        }
    }

    /// The left-invariant chart, biases outside the group.
    #[must_use]
    pub const fn left() -> Self {
        Self {
            side: Side::Left,
            ..Self::right()
        }
    }

    /// Velocity and position of the group, as far as there are.
    fn moved<'a>(&self, layout: &'a Layout, x: &[f64]) -> [Option<Moved<'a>>; 2] {
        let velocity = kinematic(layout, |k| k == Kind::Velocity);
        let position = kinematic(layout, |k| matches!(k, Kind::Position | Kind::Geodetic));
        [velocity, position].map(|block| {
            block.map(|block| Moved {
                block,
                value: self.value(block, x),
            })
        })
    }

    fn value(&self, block: &Block, x: &[f64]) -> Vector3<f64> {
        let storage = &x[block.storage_range()];
        match (block.kind, &self.origin) {
            (Kind::Geodetic, Some(origin)) => -origin.difference(&Geodetic::read(storage)),
            (Kind::Geodetic, None) => Vector3::zeros(),
            _ => Vector3::from_column_slice(storage),
        }
    }

    /// The blocks in body axes that belong to the group.
    fn turned<'a>(&self, layout: &'a Layout) -> impl Iterator<Item = &'a Block> + use<'a> {
        let takes = self.biases == Biases::TwoFrames;
        layout.blocks().iter().filter(move |b| takes && b.is_in_body_axes())
    }
}

/// A correction as an element of the group, with what its Jacobian needs.
struct Correction<'a> {
    side: Side,
    reset: Reset,
    turning: Turning<'a>,
    /// Ĉ, Exp φ, C⁺.
    before: Matrix3<f64>,
    exp: Matrix3<f64>,
    after: Matrix3<f64>,
    phi: Vector3<f64>,
    /// J_l(φ), J_r(φ).
    left: Matrix3<f64>,
    right: Matrix3<f64>,
}

impl<'a> Correction<'a> {
    fn new(side: Side, reset: Reset, turning: Turning<'a>, q: &UnitQuaternion<f64>, turn: &Vector3<f64>) -> Self {
        let before = so3::rotation(q);
        let phi = match side {
            Side::Right => before * turn,
            Side::Left => *turn,
        };
        let exp = so3::rotation(&so3::exp(&phi));
        let after = match side {
            Side::Right => exp * before,
            Side::Left => before * exp,
        };
        Self {
            side,
            reset,
            turning,
            before,
            exp,
            after,
            phi,
            left: so3::right_jacobian(&-phi),
            right: so3::right_jacobian(&phi),
        }
    }

    /// Moves a velocity or a position by δu; the change of u. Writes its rows of the reset.
    fn translate(&self, u: &Moved<'_>, delta: &[f64], by: &mut BlockMatrix) -> Vector3<f64> {
        let delta = Vector3::from_column_slice(&delta[u.block.tangent_range()]);
        let (c, full) = (&self.before, self.reset == Reset::Full);
        match self.side {
            Side::Right => {
                let nu = delta + u.value.cross(&self.phi);
                let step = self.left * nu;
                let after = self.exp * u.value + step;
                let (own, extra) = if full {
                    // Exp(ξ + dξ) = Exp(J dξ) Exp(ξ).
                    let by_turn = so3::left_jacobian_slope(&self.phi, &nu) + so3::skew(&step) * self.left;
                    (self.left, by_turn)
                } else {
                    (Matrix3::identity(), Matrix3::zeros())
                };
                let by_turn = (extra - so3::skew(&after) * own + own * so3::skew(&u.value)) * c;
                self.turning.set_column(by, u.block.tangent, &by_turn);
                at(by, u.block, u.block, &own);
                after - u.value
            }
            Side::Left => {
                let nu = c.transpose() * delta;
                let own = if full { self.right } else { Matrix3::identity() };
                if full {
                    let by_turn = c * so3::left_jacobian_slope(&self.phi, &nu);
                    self.turning.set_column(by, u.block.tangent, &by_turn);
                }
                at(by, u.block, u.block, &(self.after * own * c.transpose()));
                c * (self.left * nu)
            }
        }
    }

    /// Moves a vector in body axes, in the two-frames group.
    fn turn_vector(&self, block: &Block, value: &Vector3<f64>, delta: &[f64], by: &mut BlockMatrix) -> Vector3<f64> {
        let delta = Vector3::from_column_slice(&delta[block.tangent_range()]);
        let (c, full) = (&self.before, self.reset == Reset::Full);
        // ∂(J_r(φ)ζ)/∂φ, for J_r(φ) = J_l(−φ).
        let slope = |zeta: &Vector3<f64>| -so3::left_jacobian_slope(&-self.phi, zeta);
        match self.side {
            Side::Right => {
                let zeta = c * delta;
                let own = if full { self.left } else { Matrix3::identity() };
                if full {
                    let by_turn = self.after.transpose() * self.exp * slope(&zeta) * c;
                    self.turning.set_column(by, block.tangent, &by_turn);
                }
                at(by, block, block, &(self.after.transpose() * own * c));
                value + c.transpose() * (self.right * zeta)
            }
            Side::Left => {
                let zeta = delta - value.cross(&self.phi);
                let step = self.right * zeta;
                let after = self.exp.transpose() * value + step;
                let (own, extra) = if full {
                    (self.right, slope(&zeta) - so3::skew(&step) * self.right)
                } else {
                    (Matrix3::identity(), Matrix3::zeros())
                };
                let by_turn = extra - own * so3::skew(value) + so3::skew(&after) * own;
                self.turning.set_column(by, block.tangent, &by_turn);
                at(by, block, block, &own);
                after
            }
        }
    }

    /// Turns the rotation itself.
    fn turn(&self, x: &mut [f64], q: &UnitQuaternion<f64>, by: &mut BlockMatrix) {
        let storage = &mut x[self.turning.block().storage_range()];
        match self.turning {
            Turning::Heading(block) => block.kind.plus(storage, &[self.phi.z]),
            Turning::Attitude(_) => {
                let mut after = match self.side {
                    Side::Right => so3::exp(&self.phi) * q,
                    Side::Left => q * so3::exp(&self.phi),
                };
                after.renormalize();
                Attitude::write(&after, storage);
            }
        }
        let full = self.reset == Reset::Full;
        match self.side {
            Side::Right => {
                let own = if full { self.left } else { Matrix3::identity() };
                self.turning.set_diagonal(by, &(self.after.transpose() * own * self.before));
            }
            Side::Left if full => self.turning.set_diagonal(by, &self.right),
            Side::Left => {}
        }
    }
}

impl Chart for Invariant {
    fn to_canonical(&self, layout: &Layout, x: &[f64], t: &mut BlockMatrix) {
        let Some(turning) = Turning::of(layout) else { return };
        let c = so3::rotation(&turning.read(x));
        if self.side == Side::Right {
            turning.set_diagonal(t, &c.transpose());
        }
        for u in self.moved(layout, x).into_iter().flatten() {
            match self.side {
                Side::Right => turning.set_column(t, u.block.tangent, &-so3::skew(&u.value)),
                Side::Left => at(t, u.block, u.block, &c),
            }
        }
        for block in self.turned(layout) {
            match self.side {
                Side::Right => at(t, block, block, &c.transpose()),
                Side::Left => {
                    let b = Vector3::from_column_slice(&x[block.storage_range()]);
                    turning.set_column(t, block.tangent, &so3::skew(&b));
                }
            }
        }
    }

    fn correct(&self, layout: &Layout, x: &mut [f64], delta: &[f64], reset: Reset, by: &mut BlockMatrix) -> bool {
        let Some(turning) = Turning::of(layout) else {
            let blocks = layout.blocks().iter();
            return blocks.fold(false, |moved, block| correct_block(block, x, delta, reset, by) | moved);
        };
        let q = turning.read(x);
        let correction = Correction::new(self.side, reset, turning, &q, &turning.turn(delta));
        let moved = self.moved(layout, x);
        let is_moved = |b: &Block| moved.iter().flatten().any(|u| u.block.tangent == b.tangent);
        for block in layout.blocks() {
            let is_turned = self.biases == Biases::TwoFrames && block.is_in_body_axes();
            if block.tangent != turning.block().tangent && !is_moved(block) && !is_turned {
                correct_block(block, x, delta, reset, by);
            }
        }
        for u in moved.iter().flatten() {
            let change = correction.translate(u, delta, by);
            u.block.kind.plus(&mut x[u.block.storage_range()], change.as_slice());
        }
        for block in self.turned(layout) {
            let storage = &mut x[block.storage_range()];
            let after = correction.turn_vector(block, &Vector3::from_column_slice(storage), delta, by);
            storage.copy_from_slice(after.as_slice());
        }
        correction.turn(x, &q, by);
        true
    }

    fn difference(&self, layout: &Layout, a: &[f64], b: &[f64], delta: &mut [f64]) {
        layout.minus(a, b, delta);
        let Some(turning) = Turning::of(layout) else { return };
        let (qa, qb) = (turning.read(a), turning.read(b));
        let c = so3::rotation(&qb);
        let phi = match self.side {
            Side::Right => so3::log(&(qa * qb.inverse())),
            Side::Left => so3::log(&(qb.inverse() * qa)),
        };
        let exp = so3::rotation(&so3::exp(&phi));
        let (left, right) = (so3::right_jacobian_inverse(&-phi), so3::right_jacobian_inverse(&phi));
        for u in self.moved(layout, b).into_iter().flatten() {
            let d = &mut delta[u.block.tangent_range()];
            let change = Vector3::from_column_slice(d);
            let own = match self.side {
                Side::Right => left * (u.value + change - exp * u.value) - u.value.cross(&phi),
                Side::Left => c * (left * (c.transpose() * change)),
            };
            d.copy_from_slice(own.as_slice());
        }
        for block in self.turned(layout) {
            let d = &mut delta[block.tangent_range()];
            let (change, value) = (Vector3::from_column_slice(d), Vector3::from_column_slice(&b[block.storage_range()]));
            let own = match self.side {
                Side::Right => c.transpose() * (right * (c * change)),
                Side::Left => right * (value + change - exp.transpose() * value) + value.cross(&phi),
            };
            d.copy_from_slice(own.as_slice());
        }
        let turn = match self.side {
            Side::Right => c.transpose() * phi,
            Side::Left => phi,
        };
        turning.set_turn(&turn, delta);
    }

    fn anchored(&self, layout: &Layout, x: &[f64]) -> Option<Arc<dyn Chart>> {
        let position = kinematic(layout, |k| k == Kind::Geodetic)?;
        let is_needed = self.side == Side::Right && self.origin.is_none();
        is_needed.then(|| {
            let origin = Some(Geodetic::read(&x[position.storage_range()]));
            Arc::new(Self { origin, ..*self }) as Arc<dyn Chart>
        })
    }
}
