//! Typed handles, which a model holds instead of indices.
//!
//! A model asks for a [`Quantity`] and does not know where it is stored. It may be *fixed* by the
//! configuration, an *estimated* block of the state, or a *signal* that the process derives from
//! state and input (the bias-corrected angular rate, for example). Its Jacobian follows: a
//! no-op for a fixed quantity, a block of H for a state, the chain rule for a signal.

use super::manifold::Manifold;
use core::{fmt, marker::PhantomData};

/// A typed handle to a block of the state vector.
pub struct Slot<M> {
    pub(crate) storage: usize,
    pub(crate) tangent: usize,
    kind: PhantomData<fn() -> M>,
}

/// A typed handle to a signal of the process model.
pub struct Signal<M> {
    pub(crate) storage: usize,
    pub(crate) tangent: usize,
    kind: PhantomData<fn() -> M>,
}

macro_rules! handle {
    ($name:ident) => {
        impl<M> $name<M> {
            pub(crate) const fn new(storage: usize, tangent: usize) -> Self {
                Self {
                    storage,
                    tangent,
                    kind: PhantomData,
                }
            }

            #[doc(hidden)]
            #[must_use]
            pub const fn from_literal(storage: usize, tangent: usize) -> Self {
                Self::new(storage, tangent)
            }
        }
        impl<M> Clone for $name<M> {
            fn clone(&self) -> Self {
                *self
            }
        }
        impl<M> Copy for $name<M> {}
        impl<M> fmt::Debug for $name<M> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($name), "({})"), self.tangent)
            }
        }
    };
}
handle!(Slot);
handle!(Signal);

/// Something a model reads: fixed, estimated, or derived by the process.
pub enum Quantity<M: Manifold> {
    /// A constant of the configuration.
    Fixed(M::Value),
    /// A block of the state vector.
    State(Slot<M>),
    /// A quantity that the process model derives from state and input.
    Signal(Signal<M>),
}

/// A calibration quantity: fixed or estimated, as the configuration says.
pub type Param<M> = Quantity<M>;

impl<M: Manifold> Quantity<M> {
    /// Its value where state storage `x` is enough to know it: `None` for a signal.
    #[must_use]
    #[inline]
    pub fn stored(&self, x: &[f64]) -> Option<M::Value> {
        match self {
            Self::Fixed(value) => Some(value.clone()),
            Self::State(slot) => Some(slot.read(x)),
            Self::Signal(_) => None,
        }
    }

    /// Where its tangent starts, and whether among the signals; `None` where it is fixed.
    #[must_use]
    pub const fn place(&self) -> Option<(usize, bool)> {
        match self {
            Self::Fixed(_) => None,
            Self::State(slot) => Some((slot.tangent, false)),
            Self::Signal(signal) => Some((signal.tangent, true)),
        }
    }
}

impl<M: Manifold> Clone for Quantity<M> {
    fn clone(&self) -> Self {
        match self {
            Self::Fixed(v) => Self::Fixed(v.clone()),
            Self::State(s) => Self::State(*s),
            Self::Signal(s) => Self::Signal(*s),
        }
    }
}

impl<M: Manifold> fmt::Debug for Quantity<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(v) => write!(f, "Fixed({v:?})"),
            Self::State(s) => write!(f, "{s:?}"),
            Self::Signal(s) => write!(f, "{s:?}"),
        }
    }
}

impl<M: Manifold> From<Slot<M>> for Quantity<M> {
    fn from(slot: Slot<M>) -> Self {
        Self::State(slot)
    }
}

/// The point at which a model is evaluated: state storage, the process's signals, and the given numbers of the row
/// at hand.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    x: &'a [f64],
    signals: &'a [f64],
    given: &'a [f64],
}

impl<'a> View<'a> {
    /// A view of state storage `x` and signal storage `signals`.
    #[must_use]
    pub const fn new(x: &'a [f64], signals: &'a [f64]) -> Self {
        Self { x, signals, given: &[] }
    }

    /// The same view for a row with these given numbers, see
    /// [`Measurement::given`](crate::model::Measurement::given).
    #[must_use]
    pub const fn with_given(self, given: &'a [f64]) -> Self {
        Self { given, ..self }
    }

    /// The given numbers of the row; empty without a row.
    #[must_use]
    #[inline]
    pub const fn given(&self) -> &'a [f64] {
        self.given
    }

    /// The signal storage.
    pub(crate) const fn signals(&self) -> &'a [f64] {
        self.signals
    }

    /// The value of a quantity.
    #[inline]
    pub fn get<M: Manifold>(&self, quantity: &Quantity<M>) -> M::Value {
        match quantity {
            Quantity::Fixed(value) => value.clone(),
            Quantity::State(slot) => self.state(*slot),
            Quantity::Signal(signal) => M::read(&self.signals[signal.storage..]),
        }
    }

    /// The value of a state block.
    #[inline]
    pub fn state<M: Manifold>(&self, slot: Slot<M>) -> M::Value {
        M::read(&self.x[slot.storage..])
    }
}

impl<M: Manifold> Slot<M> {
    /// Reads the block from state storage.
    #[must_use]
    #[inline]
    pub fn read(self, x: &[f64]) -> M::Value {
        M::read(&x[self.storage..])
    }

    /// Writes the block into state storage.
    #[inline]
    pub fn write(self, value: &M::Value, x: &mut [f64]) {
        M::write(value, &mut x[self.storage..]);
    }
}
