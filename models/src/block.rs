//! How a block is declared and built.
//!
//! A *spec* is plain data read from TOML. [`SensorSpec::build`] and its siblings turn it into the
//! runtime object of `fusion-core`, resolving the quantities it reads through [`Build`].

#![cfg(feature = "declare")]

pub use crate::channel::{Channel, Shape};
pub use crate::error::BuildError;

use crate::earth::Gravity;
use crate::param::{ParamSpec, ParamValue};
use crate::units::Dimension;
use crate::vocabulary::channel;
use core::fmt::{self, Debug};
use core::marker::PhantomData;
use fusion_core::gate::Gate;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::loss::Loss;
use fusion_core::model::{Measurement, Process};
use fusion_core::runner::{Initialiser, Stage};
use fusion_core::state::{Declaration, Dynamics, LayoutBuilder, Manifold, Param, Quantity, QuantityName, Signal, Slot, StateRole, Vector};
use serde::Deserialize;
use serde::de::{Deserializer, Visitor};

/// The name by which a [`NestedBlock`] identifies itself to the deserializer.
pub const NESTED: &str = "$fusion::block";

/// A block inside another, `{ type = "…", … }`. It informs the reader of a design that `type` names a
/// trait object. A field that holds a `Box<dyn …>` is read through it; for an array of blocks,
/// use [`nested`].
#[derive(Debug)]
pub struct NestedBlock<T: ?Sized>(pub Box<T>);

impl<'de, T: ?Sized> Deserialize<'de> for NestedBlock<T>
where
    Box<T>: Deserialize<'de>,
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Block<T: ?Sized>(PhantomData<Box<T>>);
        impl<'de, T: ?Sized> Visitor<'de> for Block<T>
        where
            Box<T>: Deserialize<'de>,
        {
            type Value = NestedBlock<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table with a `type`")
            }
            fn visit_newtype_struct<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
                Box::<T>::deserialize(deserializer).map(NestedBlock)
            }
        }
        deserializer.deserialize_newtype_struct(NESTED, Block(PhantomData))
    }
}

/// Reads an array of blocks, as `#[serde(deserialize_with = "nested")]`.
///
/// # Errors
/// Those of the blocks.
pub fn nested<'de, D: Deserializer<'de>, T: ?Sized>(deserializer: D) -> Result<Vec<Box<T>>, D::Error>
where
    Box<T>: Deserialize<'de>,
{
    let blocks = Vec::<NestedBlock<T>>::deserialize(deserializer)?;
    Ok(blocks.into_iter().map(|block| block.0).collect())
}

/// Axes of rows resolved in navigation axes.
pub(crate) const NED: &[&str] = &["north", "east", "down"];
/// Axes of rows resolved in the axes of a body or sensor.
pub(crate) const XYZ: &[&str] = &["x", "y", "z"];

/// The channels of an inertial measurement unit.
#[must_use]
pub fn imu_channels() -> Vec<Channel> {
    vec![channel::ANGULAR_RATE, channel::SPECIFIC_FORCE]
}

/// The longest delay that a sensor or a channel may declare, 1 h \[s\]: every row is held back as
/// long as the longest of them.
pub const LONGEST_DELAY: f64 = 3600.0;

/// Refuses a delay of more than [`LONGEST_DELAY`], of either sign, that `field` declares.
///
/// # Errors
/// [`BuildError`] at `field`.
pub fn check_delay(field: impl Into<String>, seconds: f64) -> Result<(), BuildError> {
    if seconds.abs() <= LONGEST_DELAY {
        return Ok(());
    }
    let message = format!("{seconds} s is more than the longest delay of {LONGEST_DELAY} s: all rows would be held back for that long");
    let help = "correct a difference between clocks where stamps are read: `time.epoch` or `time.offset` of a source";
    Err(BuildError::at(field, message).help(help))
}

/// The data that a sensor reads from its stream.
#[derive(Clone, Debug, PartialEq)]
pub enum Reading {
    /// A channel of the source's rows.
    Channel(Channel),
    /// Several channels of the same row, one after the other.
    Channels(Vec<Channel>),
    /// Nothing: a pseudo-measurement of this constant value, timed by the rows.
    Constant(Vec<f64>),
}

impl Reading {
    /// The channels it takes from a row; empty for a pseudo-measurement.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        match self {
            Self::Channel(channel) => core::slice::from_ref(channel),
            Self::Channels(channels) => channels,
            Self::Constant(_) => &[],
        }
    }

    /// How many numbers a measured value has.
    #[must_use]
    pub fn width(&self) -> usize {
        match self {
            Self::Constant(value) => value.len(),
            _ => self.channels().iter().map(|channel| channel.width).sum(),
        }
    }
}

/// A channel that a stage or an initialiser listens to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listen {
    /// Name of the source or stage.
    pub source: String,
    /// The channels wanted, one after the other in the row the block sees.
    pub channels: Vec<Channel>,
}

/// A process model as declared.
#[typetag::deserialize]
pub trait ProcessSpec: Debug + Send + Sync {
    /// The channels of an input sample; empty for a process driven by time alone.
    fn input(&self) -> Vec<Channel>;

    /// Declares the states and signals and makes the model.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, build: &mut Build<'_>) -> Result<Box<dyn Process>, BuildError>;
}

/// A measurement model as declared. Source, noise, time offset, gate and loss are its siblings and are
/// read by the assembler.
#[typetag::deserialize]
pub trait SensorSpec: Debug + Send + Sync {
    /// The data that it reads.
    fn reading(&self) -> Reading;

    /// The dimension of each residual row, which is also the dimension of the noise's sigma.
    fn noise(&self) -> Vec<Dimension>;

    /// A name per residual row, `north` or `x`; empty if rows have no names, as in a scalar. If several
    /// similar quantities are measured together, the names of one of them: they repeat.
    fn axes(&self) -> &'static [&'static str] {
        &[]
    }

    /// The channel of its stream that reports the 1σ of each residual row, for `noise.from_source`:
    /// `<channel>_sigma`. A single number applies to every row; numbers beyond the rows are ignored.
    /// `None` for a pseudo-measurement, which has no source that could report it, and for a sensor with several
    /// channels, unless it names one.
    fn reported_sigma(&self) -> Option<Channel> {
        let Reading::Channel(channel) = self.reading() else { return None };
        Some(Channel {
            name: Channel::sigma_name(&channel.name).into(),
            width: channel.degrees(),
            dimension: self.noise().first().copied().unwrap_or(Dimension::NONE),
            shape: Shape::Vector,
        })
    }

    /// The stage whose rows define when it holds, if it is no instrument with its own rows.
    fn timing(&self) -> Option<&'static str> {
        match self.reading() {
            Reading::Constant(_) => Some("periodic"),
            _ => None,
        }
    }

    /// The sensor whose states it reads, if it names one. That sensor is built first, and used first at a common
    /// time, for any order of the two in a design.
    fn follows(&self) -> Option<&str> {
        None
    }

    /// Declares the states it brings and makes the model.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, build: &mut Build<'_>) -> Result<Box<dyn Measurement>, BuildError>;
}

/// A stage as declared.
#[typetag::deserialize]
pub trait StageSpec: Debug + Send + Sync {
    /// The channels that it listens to, one entry per input.
    fn inputs(&self) -> Vec<Listen>;

    /// The channels of its rows.
    fn output(&self) -> Vec<Channel>;

    /// The time in seconds by which it sees the rows of each input before their stamps; its output may
    /// be valid earlier by this time. Empty for a stage that sees rows at their stamps. All rows of the
    /// run are held back by the longest of these times.
    fn ahead(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Makes the stage. The layout is complete by then; quantities may be read, not declared.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, build: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError>;
}

/// An initialiser as declared.
#[typetag::deserialize]
pub trait InitialiserSpec: Debug + Send + Sync {
    /// The channels that it listens to, one entry per input.
    fn inputs(&self) -> Vec<Listen>;

    /// Names of the state blocks it writes.
    fn writes(&self) -> Vec<&'static str>;

    /// How it uses the position in the rows of its first input, which sensors may read too.
    fn takes(&self) -> Taken {
        Taken::Nothing
    }

    /// Makes the initialiser. The layout is complete by then.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self, build: &mut Build<'_>) -> Result<Box<dyn Initialiser>, BuildError>;
}

/// How an initialiser uses a measured position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Taken {
    /// Not at all, or only as its own documentation says.
    Nothing,
    /// As the place of the start only: the sensors measure the position.
    Place,
    /// As a position with this 1σ per axis \[m\], independent of all sensor measurements.
    Position([f64; 3]),
}

/// A gate policy as declared.
#[typetag::deserialize]
pub trait GateSpec: Debug + Send + Sync {
    /// Whether it can judge a sensor with residual rows of these dimensions; most judge any.
    ///
    /// # Errors
    /// [`BuildError`] that says what it needs.
    fn suits(&self, rows: &[Dimension]) -> Result<(), BuildError> {
        let _ = rows;
        Ok(())
    }

    /// Whether it leaves decisions to a bank of hypotheses.
    fn needs_bank(&self) -> bool {
        false
    }

    /// Whether it judges by the number that the sensor names as its `quality`.
    fn needs_quality(&self) -> bool {
        false
    }

    /// Makes the gate.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self) -> Result<Box<dyn Gate>, BuildError>;
}

/// A loss as declared.
#[typetag::deserialize]
pub trait LossSpec: Debug + Send + Sync {
    /// Makes the loss.
    ///
    /// # Errors
    /// [`BuildError`] naming the field.
    fn build(&self) -> Result<Box<dyn Loss>, BuildError>;
}

/// The data that a block sees while it is built: its name, the layout so far, the world.
#[derive(Debug)]
pub struct Build<'a> {
    /// The block's own name; its states are called `name.parameter`.
    pub name: &'a str,
    /// The layout under construction.
    pub layout: &'a mut LayoutBuilder,
    /// The declared origin of local coordinates.
    pub origin: Option<Geodetic>,
    /// The gravity model.
    pub gravity: Gravity,
}

impl Build<'_> {
    /// A quantity of the process, a state or a signal, by one of the names of
    /// [`vocabulary::state`](crate::vocabulary::state) or by another.
    ///
    /// # Errors
    /// Where it is missing or of another kind.
    pub fn quantity<'n, M: Manifold>(&self, name: impl Into<QuantityName<'n, M>>) -> Result<Quantity<M>, BuildError> {
        self.layout
            .so_far()
            .quantity(name)
            .map_err(|e| BuildError::new(e.to_string()).help("add the state to the process, or remove this block"))
    }

    /// The declared origin.
    ///
    /// # Errors
    /// If no origin is declared.
    pub fn origin(&self) -> Result<Geodetic, BuildError> {
        let help = "add `origin = { latitude = \"…deg\", longitude = \"…deg\", height = \"…m\" }` under [run]";
        self.origin
            .ok_or_else(|| BuildError::new("this block needs an origin of local coordinates").help(help))
    }

    /// Declares a state of the process: a kinematic one, see [`StateRole`].
    ///
    /// # Errors
    /// A duplicate name, or numbers that do not fit.
    pub fn declare<'n, M: Manifold>(
        &mut self,
        name: impl Into<QuantityName<'n, M>>,
        unit: &'static str,
        initial: M::Value,
        sigma: Vec<f64>,
        dynamics: Dynamics,
    ) -> Result<Slot<M>, BuildError> {
        Ok(self.layout.declare::<M>(Declaration {
            name: name.into().as_str().to_owned(),
            owner: self.name.to_owned(),
            unit,
            initial,
            sigma,
            role: StateRole::Kinematic,
            dynamics,
        })?)
    }

    /// Declares a signal of the process.
    ///
    /// # Errors
    /// A duplicate name.
    pub fn signal<'n, M: Manifold>(&mut self, name: impl Into<QuantityName<'n, M>>) -> Result<Signal<M>, BuildError> {
        Ok(self.layout.signal::<M>(name)?)
    }

    /// A parameter: fixed, estimated as `block.field`, or shared with another block. Estimated it is
    /// a calibration, and with a correlation time a nuisance, see [`StateRole`].
    ///
    /// # Errors
    /// A bad declaration, or a shared state that is not there yet.
    pub fn param<V: ParamValue>(&mut self, field: &str, spec: &ParamSpec<V>) -> Result<Param<V::Manifold>, BuildError> {
        let role = if spec.is_correlated() {
            StateRole::Nuisance
        } else {
            StateRole::Calibration
        };
        self.parameter(&format!("{}.{field}", self.name), field, spec, role)
    }

    /// A parameter of a process, under its own full name. If it is estimated, it is a calibration
    /// with any dynamics.
    ///
    /// # Errors
    /// As [`Build::param`].
    pub fn param_named<'n, V: ParamValue>(
        &mut self,
        name: impl Into<QuantityName<'n, V::Manifold>>,
        field: &str,
        spec: &ParamSpec<V>,
    ) -> Result<Param<V::Manifold>, BuildError> {
        self.parameter(name.into().as_str(), field, spec, StateRole::Calibration)
    }

    /// A vector of a process resolved in body axes, such as a bias; otherwise as
    /// [`Build::param_named`].
    ///
    /// # Errors
    /// As [`Build::param`].
    pub fn body_param<'n, V: ParamValue<Manifold = Vector<3>>>(
        &mut self,
        name: impl Into<QuantityName<'n, Vector<3>>>,
        field: &str,
        spec: &ParamSpec<V>,
    ) -> Result<Param<Vector<3>>, BuildError> {
        let param = self.param_named(name, field, spec)?;
        if let Param::State(slot) = param {
            self.layout.resolve_in_body(slot);
        }
        Ok(param)
    }

    fn parameter<V: ParamValue>(
        &mut self,
        name: &str,
        field: &str,
        spec: &ParamSpec<V>,
        role: StateRole,
    ) -> Result<Param<V::Manifold>, BuildError> {
        match spec {
            ParamSpec::Fixed(value) => Ok(Param::Fixed(value.value())),
            ParamSpec::Shared(other) => {
                let slot = self.layout.so_far().slot::<V::Manifold>(other);
                slot.map(Param::State).map_err(|e| {
                    let help = "a shared state must be estimated by a block declared earlier in the file";
                    BuildError::at(format!("{field}.shared"), e.to_string()).help(help)
                })
            }
            ParamSpec::Estimated(e) => {
                let dynamics = e.dynamics().map_err(|e| e.within(field))?;
                let (initial, sigma) = (e.initial.value(), V::axes(&e.sigma).to_vec());
                if sigma.iter().all(|s| *s == 0.0) && !matches!(dynamics, Dynamics::RandomWalk { .. }) {
                    let message = "a parameter whose 1σ is 0 on every axis is never corrected: it is a constant, not estimated";
                    let help =
                        "give it the uncertainty of its initial value, or `estimate = false`; an axis of 0 beside others is kept as it is";
                    return Err(BuildError::at(format!("{field}.sigma"), message).help(help));
                }
                let (name, owner) = (name.to_owned(), self.name.to_owned());
                let declared = Declaration {
                    name,
                    owner,
                    unit: V::SYMBOL,
                    initial,
                    sigma,
                    role,
                    dynamics,
                };
                let slot = self.layout.declare::<V::Manifold>(declared);
                slot.map(Param::State).map_err(|e| BuildError::at(field, e.to_string()))
            }
        }
    }
}
