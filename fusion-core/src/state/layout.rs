//! The layout of the state vector: which blocks there are, who declares them, where they lie.

use super::manifold::{Kind, Manifold, Vector, is_rotation};
use super::name::QuantityName;
use super::quantity::{Quantity, Signal, Slot};
use super::space::Space;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use thiserror::Error;

/// How a block moves by itself between measurements.
#[derive(Clone, Debug, PartialEq)]
pub enum Dynamics {
    /// The process model moves it.
    Process,
    /// ẋ = 0.
    Constant,
    /// ẋ = w with the given power spectral density per tangent axis \[unit²/s\].
    RandomWalk {
        /// Power spectral density of w, per tangent axis.
        psd: Vec<f64>,
    },
    /// First-order Gauss-Markov: ẋ = −x/τ + w, stationary 1σ per tangent axis, τ in seconds.
    /// Discretised exactly: x⁺ = e^{−Δt/τ}x, variance σ²(1 − e^{−2Δt/τ}).
    GaussMarkov {
        /// Stationary standard deviation, per tangent axis.
        sigma: Vec<f64>,
        /// Correlation time \[s\].
        tau: f64,
    },
    /// ẋ = r + w: the integral of another block r, plus a random walk. The offset of a clock is the integral of its
    /// drift. Discretised exactly; r is constant or a random walk, and declared before.
    Integral {
        /// The name of r, which has as many axes.
        rate: String,
        /// Power spectral density of w, per tangent axis \[unit²/s\].
        psd: Vec<f64>,
    },
}

/// The purpose of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StateRole {
    /// The motion: the process moves this block.
    Kinematic,
    /// A property of the equipment or the surroundings that the filter estimates: a bias, a lever
    /// arm, the level of the sea.
    Calibration,
    /// An error of one sensor's measurements that is correlated in time: a state only so that it is
    /// not taken for white noise.
    Nuisance,
}

/// One named block of the state vector.
#[derive(Clone, Debug)]
pub struct Block {
    /// Unique name, `owner.parameter` or the process's own name for it.
    pub name: String,
    /// Its manifold.
    pub kind: Kind,
    /// Offset in state storage.
    pub storage: usize,
    /// Offset in the tangent space, i.e. in the covariance.
    pub tangent: usize,
    /// Its purpose.
    pub role: StateRole,
    /// Its own dynamics.
    pub dynamics: Dynamics,
    /// The model that brought it.
    pub owner: String,
    /// Unit of a tangent coordinate, for display.
    pub unit: &'static str,
    /// Initial 1σ per tangent axis.
    pub sigma: Vec<f64>,
    /// Whether it is a vector resolved in body axes.
    in_body_axes: bool,
}

impl Block {
    /// All fields in order.
    #[doc(hidden)]
    #[must_use]
    #[expect(clippy::too_many_arguments, reason = "one per field")]
    pub const fn from_literal(
        name: String,
        kind: Kind,
        storage: usize,
        tangent: usize,
        role: StateRole,
        dynamics: Dynamics,
        owner: String,
        unit: &'static str,
        sigma: Vec<f64>,
        in_body_axes: bool,
    ) -> Self {
        Self {
            name,
            kind,
            storage,
            tangent,
            role,
            dynamics,
            owner,
            unit,
            sigma,
            in_body_axes,
        }
    }

    /// Whether it is a vector resolved in body axes, such as the bias of a gyro: three numbers that
    /// turn with the body.
    #[must_use]
    pub const fn is_in_body_axes(&self) -> bool {
        self.in_body_axes
    }

    /// The block's range in state storage.
    #[must_use]
    pub fn storage_range(&self) -> core::ops::Range<usize> {
        self.storage..self.storage + self.kind.storage()
    }

    /// The block's range in tangent coordinates.
    #[must_use]
    pub fn tangent_range(&self) -> core::ops::Range<usize> {
        self.tangent..self.tangent + self.kind.dim()
    }
}

/// A block as its owner declares it.
#[derive(Clone, Debug)]
pub struct Declaration<V> {
    /// Unique name.
    pub name: String,
    /// The model that brings it.
    pub owner: String,
    /// Unit of a tangent coordinate, for display.
    pub unit: &'static str,
    /// Initial value.
    pub initial: V,
    /// Initial 1σ per tangent axis.
    pub sigma: Vec<f64>,
    /// Its purpose.
    pub role: StateRole,
    /// Its own dynamics.
    pub dynamics: Dynamics,
}

/// Why a layout could not be built.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum LayoutError {
    /// Two blocks or signals with the same name.
    #[error("`{name}` is declared by both `{first}` and `{second}`; give one of them another name")]
    Duplicate {
        /// The name.
        name: String,
        /// The first owner.
        first: String,
        /// The second owner.
        second: String,
    },
    /// A model needs a quantity that does not exist.
    #[error("no `{name}` here: neither a state nor a signal of the process; available: {available}")]
    Missing {
        /// The name asked for.
        name: String,
        /// The available names.
        available: String,
    },
    /// The quantity exists but has another kind.
    #[error("`{name}` is {found}, and {wanted} is needed")]
    WrongKind {
        /// The name asked for.
        name: String,
        /// Its kind.
        found: String,
        /// The kind asked for.
        wanted: String,
    },
    /// Numbers that do not fit the block.
    #[error("`{name}`: {reason}")]
    BadDeclaration {
        /// The block.
        name: String,
        /// The reason.
        reason: String,
    },
}

#[derive(Clone, Debug)]
struct SignalInfo {
    name: String,
    kind: Kind,
    storage: usize,
    tangent: usize,
}

/// The finished, immutable layout.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    blocks: Vec<Block>,
    signals: Vec<SignalInfo>,
    storage: usize,
    dim: usize,
    signal_storage: usize,
    signal_dim: usize,
    initial: Vec<f64>,
    /// The largest size of each number in storage, and where attitudes begin.
    limits: Vec<f64>,
    attitudes: Vec<usize>,
    /// Where values of custom manifolds begin.
    customs: Vec<(usize, &'static Space)>,
}

impl Layout {
    /// The layout of these blocks, and of these signals: their names and kinds.
    #[doc(hidden)]
    #[must_use]
    pub fn from_literal(blocks: Vec<Block>, signals: Vec<(String, Kind)>, initial: Vec<f64>) -> Self {
        let mut layout = Self {
            initial,
            ..Self::default()
        };
        for block in &blocks {
            layout.take(block.kind);
        }
        for (name, kind) in signals {
            layout.add_signal(name, kind);
        }
        Self { blocks, ..layout }
    }

    /// Makes room for a block of this kind.
    fn take(&mut self, kind: Kind) {
        if kind == Kind::Attitude {
            self.attitudes.push(self.storage);
        }
        if let Kind::Custom(space) = kind {
            self.customs.push((self.storage, space));
        }
        self.limits.extend((0..kind.storage()).map(|k| kind.limit(k)));
        self.storage += kind.storage();
        self.dim += kind.dim();
    }

    fn add_signal(&mut self, name: String, kind: Kind) {
        self.signals.push(SignalInfo {
            name,
            kind,
            storage: self.signal_storage,
            tangent: self.signal_dim,
        });
        self.signal_storage += kind.storage();
        self.signal_dim += kind.dim();
    }

    /// The blocks in order.
    #[must_use]
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The block of that name.
    #[must_use]
    pub fn block(&self, name: impl AsRef<str>) -> Option<&Block> {
        self.blocks.iter().find(|b| b.name == name.as_ref())
    }

    /// Numbers in state storage.
    #[must_use]
    pub const fn storage(&self) -> usize {
        self.storage
    }

    /// Dimension of the tangent space: rows of the covariance.
    #[must_use]
    pub const fn dim(&self) -> usize {
        self.dim
    }

    /// Numbers in signal storage.
    #[must_use]
    pub const fn signal_storage(&self) -> usize {
        self.signal_storage
    }

    /// Tangent dimension of all signals.
    #[must_use]
    pub const fn signal_dim(&self) -> usize {
        self.signal_dim
    }

    /// Names and kinds of the process's signals, with their storage and tangent offsets.
    pub fn signals(&self) -> impl Iterator<Item = (&str, Kind, usize, usize)> {
        self.signals.iter().map(|s| (s.name.as_str(), s.kind, s.storage, s.tangent))
    }

    /// The declared initial state.
    #[must_use]
    pub fn initial(&self) -> &[f64] {
        &self.initial
    }

    /// Whether every block of the state `x` is sane: [`Kind::is_sane`].
    #[must_use]
    pub fn is_sane(&self, x: &[f64]) -> bool {
        // Without branches in between: it nearly always is.
        let is_below = x.iter().zip(&self.limits).fold(true, |all, (v, limit)| all & (v.abs() <= *limit));
        let is_custom_sane = |(at, space): &(usize, &Space)| (space.is_sane)(&x[*at..at + space.origin.len()]);
        is_below && self.attitudes.iter().all(|&at| is_rotation(&x[at..at + 4])) && self.customs.iter().all(is_custom_sane)
    }

    /// The orientations of the motion: attitudes, headings, and custom ones.
    pub(crate) fn orientations(&self) -> impl Iterator<Item = &Block> {
        let motion = self.blocks.iter().filter(|b| b.role == StateRole::Kinematic);
        motion.filter(|b| b.kind.is_orientation())
    }

    /// x ← x ⊞ δ over all blocks.
    pub fn plus(&self, x: &mut [f64], delta: &[f64]) {
        for b in &self.blocks {
            b.kind.plus(&mut x[b.storage_range()], &delta[b.tangent_range()]);
        }
    }

    /// out ← a ⊟ b over all blocks.
    pub fn minus(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        for block in &self.blocks {
            let s = block.storage_range();
            block.kind.minus(&a[s.clone()], &b[s], &mut out[block.tangent_range()]);
        }
    }

    /// The block of a handle.
    #[must_use]
    pub fn block_of<M: Manifold>(&self, slot: Slot<M>) -> Option<&Block> {
        self.blocks.iter().find(|b| b.tangent == slot.tangent)
    }

    /// A typed handle to the state block `name`.
    ///
    /// # Errors
    /// [`LayoutError::Missing`] or [`LayoutError::WrongKind`].
    pub fn slot<'n, M: Manifold>(&self, name: impl Into<QuantityName<'n, M>>) -> Result<Slot<M>, LayoutError> {
        let name = name.into().as_str();
        match self.block(name) {
            Some(b) if b.kind == M::KIND => Ok(Slot::new(b.storage, b.tangent)),
            Some(b) => Err(wrong_kind(name, b.kind, M::KIND)),
            None => Err(self.missing(name)),
        }
    }

    /// A handle to the state block or, failing that, the signal `name`.
    ///
    /// # Errors
    /// [`LayoutError::Missing`] or [`LayoutError::WrongKind`].
    pub fn quantity<'n, M: Manifold>(&self, name: impl Into<QuantityName<'n, M>>) -> Result<Quantity<M>, LayoutError> {
        let name = name.into().as_str();
        if self.block(name).is_some() {
            return self.slot(name).map(Quantity::State);
        }
        match self.signals.iter().find(|s| s.name == name) {
            Some(s) if s.kind == M::KIND => Ok(Quantity::Signal(Signal::new(s.storage, s.tangent))),
            Some(s) => Err(wrong_kind(name, s.kind, M::KIND)),
            None => Err(self.missing(name)),
        }
    }

    fn missing(&self, name: &str) -> LayoutError {
        let names = self.blocks.iter().map(|b| &b.name).chain(self.signals.iter().map(|s| &s.name));
        let available = names.map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
        LayoutError::Missing {
            name: name.to_owned(),
            available,
        }
    }
}

fn wrong_kind(name: &str, found: Kind, wanted: Kind) -> LayoutError {
    LayoutError::WrongKind {
        name: name.to_owned(),
        found: format!("{found:?}"),
        wanted: format!("{wanted:?}"),
    }
}

/// Collects declarations; [`LayoutBuilder::finish`] makes the layout.
///
/// Handles are valid as soon as they are returned: blocks are laid out in order of declaration.
#[derive(Clone, Debug, Default)]
pub struct LayoutBuilder {
    layout: Layout,
}

/// Whether a block of `kind` may be the integral of `rate`.
fn is_rate(rate: &Block, kind: Kind) -> bool {
    let is_walking = matches!(rate.dynamics, Dynamics::Constant | Dynamics::RandomWalk { .. });
    is_walking && kind.is_linear() && rate.kind.is_linear() && rate.kind.dim() == kind.dim()
}

impl LayoutBuilder {
    /// An empty layout.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The layout declared so far.
    #[must_use]
    pub const fn so_far(&self) -> &Layout {
        &self.layout
    }

    /// Adds a block to the state.
    ///
    /// # Errors
    /// A duplicate name, or numbers whose count or range does not fit the block.
    pub fn declare<M: Manifold>(&mut self, d: Declaration<M::Value>) -> Result<Slot<M>, LayoutError> {
        let l = &mut self.layout;
        if let Some(first) = l.block(&d.name) {
            return Err(LayoutError::Duplicate {
                name: d.name.clone(),
                first: first.owner.clone(),
                second: d.owner,
            });
        }
        let dim = M::KIND.dim();
        let most = Space::MOST_AXES;
        if matches!(M::KIND, Kind::Custom(_)) && !(1..=most).contains(&dim) {
            return Err(LayoutError::BadDeclaration {
                name: d.name,
                reason: format!("a custom manifold has 1 to {most} axes, this one has {dim}"),
            });
        }
        let fits = |v: &[f64]| v.len() == dim && v.iter().all(|s| s.is_finite() && *s >= 0.0);
        let bad = |reason: &str| LayoutError::BadDeclaration {
            name: d.name.clone(),
            reason: reason.to_owned(),
        };
        if !fits(&d.sigma) {
            return Err(bad("sigma needs one finite, non-negative number per axis"));
        }
        match &d.dynamics {
            Dynamics::GaussMarkov { .. } if !M::KIND.is_linear() && M::KIND != Kind::Angle => {
                return Err(bad(
                    "a rotation, a geodetic position or a custom manifold does not decay to zero: use a random walk, or no correlation time",
                ));
            }
            Dynamics::RandomWalk { psd } if !fits(psd) => return Err(bad("psd needs one finite, non-negative number per axis")),
            Dynamics::Integral { psd, .. } if !fits(psd) => return Err(bad("psd needs one finite, non-negative number per axis")),
            Dynamics::Integral { rate, .. } if !l.block(rate).is_some_and(|r| is_rate(r, M::KIND)) => {
                return Err(bad(
                    "the rate of an integral is a block declared before it, constant or a random walk, linear and with as many axes",
                ));
            }
            Dynamics::GaussMarkov { sigma, tau } if !(fits(sigma) && tau.is_finite() && *tau > 0.0) => {
                return Err(bad("a Gauss-Markov block needs a non-negative sigma per axis and a positive tau"));
            }
            _ => {}
        }
        let slot = Slot::new(l.storage, l.dim);
        l.initial.resize(l.storage + M::KIND.storage(), 0.0);
        M::write(&d.initial, &mut l.initial[l.storage..]);
        let initial = &l.initial[l.storage..];
        let fault = if initial.iter().any(|v| !v.is_finite()) {
            Some("the initial value must be finite")
        } else if matches!(M::KIND, Kind::Custom(space) if !(space.is_sane)(initial)) {
            Some("the initial value is no point of its manifold")
        } else {
            None
        };
        if let Some(fault) = fault {
            l.initial.truncate(l.storage);
            return Err(bad(fault));
        }
        l.blocks.push(Block {
            name: d.name,
            kind: M::KIND,
            storage: l.storage,
            tangent: l.dim,
            role: d.role,
            dynamics: d.dynamics,
            owner: d.owner,
            unit: d.unit,
            sigma: d.sigma,
            in_body_axes: false,
        });
        l.take(M::KIND);
        Ok(slot)
    }

    /// Says that a block is a vector resolved in body axes: [`Block::is_in_body_axes`].
    pub fn resolve_in_body(&mut self, slot: Slot<Vector<3>>) {
        if let Some(block) = self.layout.blocks.iter_mut().find(|b| b.tangent == slot.tangent) {
            block.in_body_axes = true;
        }
    }

    /// Adds a signal of the process model.
    ///
    /// # Errors
    /// A duplicate name.
    pub fn signal<'n, M: Manifold>(&mut self, name: impl Into<QuantityName<'n, M>>) -> Result<Signal<M>, LayoutError> {
        let name = name.into().as_str();
        let l = &mut self.layout;
        if l.signals.iter().any(|s| s.name == name) || l.block(name).is_some() {
            let process = "process".to_owned();
            return Err(LayoutError::Duplicate {
                name: name.to_owned(),
                first: process.clone(),
                second: process,
            });
        }
        let signal = Signal::new(l.signal_storage, l.signal_dim);
        l.add_signal(name.to_owned(), M::KIND);
        Ok(signal)
    }

    /// The finished layout.
    #[must_use]
    pub fn finish(self) -> Layout {
        self.layout
    }
}
