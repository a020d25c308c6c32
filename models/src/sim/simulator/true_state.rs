//! The true state in the layout of the filter.

use super::super::inverse::Sample;
use super::super::random::Random;
use super::super::sea::SeaSpec;
use super::super::ship::{Ship, ShipSpec};
use super::super::spec::SimulationSpec;
use super::super::world::Truth;
use super::Setup;
use crate::block::{BuildError, Channel};
use crate::earth::{Gravity, LocalEarth, LocalFrame};
use crate::spelling::did_you_mean;
use crate::vocabulary::{channel, parameter, state};
use core::ops::Range;
use fusion_core::Time;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::math;
use fusion_core::model::{Input, Process, SignalBuffer};
use fusion_core::state::{
    Angle, Attitude, Block, Dynamics, Kind, Layout, LayoutError, Manifold, Position, QuantityName, Scalar, Slot, StateRole, Vector,
    Velocity, View,
};
use nalgebra::Vector3;
use std::sync::Arc;

/// The true state in the layout of the filter, and the signals there.
#[derive(Debug)]
pub(super) struct TrueState {
    x: Vec<f64>,
    signals: SignalBuffer,
    process: Arc<dyn Process>,
    input: Vec<InputPart>,
    sample: Vec<f64>,
    frame: LocalFrame,
    gravity: Gravity,
    known: Vec<Known>,
    /// The sea that carries a boat, and the ranges of its velocity in the state.
    sea: Option<SeaSpec>,
    currents: Vec<Range<usize>>,
    /// The ships whose pose is in the state.
    ships: Vec<(Ship, Pose)>,
    parameters: Vec<Parameter>,
    /// Names of the blocks that are truly at their declared initial value.
    undrawn: Vec<String>,
    moved: Time,
}

/// A part of the process's input sample.
#[derive(Clone, Copy, Debug)]
enum InputPart {
    Rate,
    Force,
    /// Speed ahead.
    Forward,
    /// Speed to the right.
    Sideways,
    /// Rate of the heading.
    YawRate,
    /// The attitude of a reference whose rows a stage makes.
    Attitude,
}

/// A block whose value the world knows.
#[derive(Clone, Copy, Debug)]
pub(in super::super) enum Known {
    Geodetic(Slot<Geodetic>),
    Local(Slot<Position>),
    Velocity(Slot<Velocity>),
    Attitude(Slot<Attitude>),
    Heading(Slot<Angle>),
    Speed(Slot<Scalar>),
    YawRate(Slot<Scalar>),
    GyroBias(Slot<Vector<3>>),
    AccelBias(Slot<Vector<3>>),
    GyroScale(Slot<Vector<3>>),
    AccelScale(Slot<Vector<3>>),
    BodyVelocity(Slot<Vector<3>>),
    HeadingOffset(Slot<Scalar>),
    Drift(Slot<Vector<3>>),
}

/// The names that a simulated world knows, each with the handle to it in a layout.
type KnownName = (&'static str, fn(&Layout) -> Result<Known, LayoutError>);
const KNOWN: [KnownName; 14] = [
    (state::POSITION.as_str(), |l| l.slot(state::POSITION).map(Known::Geodetic)),
    (state::LOCAL_POSITION.as_str(), |l| l.slot(state::LOCAL_POSITION).map(Known::Local)),
    (state::VELOCITY.as_str(), |l| l.slot(state::VELOCITY).map(Known::Velocity)),
    (state::ATTITUDE.as_str(), |l| l.slot(state::ATTITUDE).map(Known::Attitude)),
    (state::HEADING.as_str(), |l| l.slot(state::HEADING).map(Known::Heading)),
    (state::SPEED.as_str(), |l| l.slot(state::SPEED).map(Known::Speed)),
    (state::YAW_RATE.as_str(), |l| l.slot(state::YAW_RATE).map(Known::YawRate)),
    (state::GYRO_BIAS.as_str(), |l| l.slot(state::GYRO_BIAS).map(Known::GyroBias)),
    (state::ACCEL_BIAS.as_str(), |l| l.slot(state::ACCEL_BIAS).map(Known::AccelBias)),
    (state::GYRO_SCALE.as_str(), |l| l.slot(state::GYRO_SCALE).map(Known::GyroScale)),
    (state::ACCEL_SCALE.as_str(), |l| l.slot(state::ACCEL_SCALE).map(Known::AccelScale)),
    (state::BODY_VELOCITY.as_str(), |l| {
        l.slot(state::BODY_VELOCITY).map(Known::BodyVelocity)
    }),
    (state::HEADING_OFFSET.as_str(), |l| {
        l.slot(state::HEADING_OFFSET).map(Known::HeadingOffset)
    }),
    (state::DRIFT.as_str(), |l| l.slot(state::DRIFT).map(Known::Drift)),
];

impl Known {
    /// Writes the true motion into the block, without the errors of the inertial unit.
    pub(in super::super) fn write(&self, truth: &Truth, frame: &LocalFrame, gravity: Gravity, x: &mut [f64]) {
        let (nav, heading) = (&truth.nav, || so3::to_rpy(&truth.nav.q_nb).z);
        match self {
            Self::Geodetic(slot) => slot.write(&nav.position, x),
            Self::Local(slot) => slot.write(&frame.to_ned(&nav.position), x),
            Self::Velocity(slot) => slot.write(&nav.v_eb_n, x),
            Self::Attitude(slot) => slot.write(&nav.q_nb, x),
            Self::Heading(slot) => slot.write(&heading(), x),
            Self::Speed(slot) => {
                let (sin, cos) = math::sin_cos(heading());
                slot.write(&(nav.v_eb_n.x * cos + nav.v_eb_n.y * sin), x);
            }
            Self::YawRate(slot) => slot.write(&yaw_rate(truth, gravity), x),
            Self::BodyVelocity(slot) => slot.write(&nav.q_nb.inverse_transform_vector(&nav.v_eb_n), x),
            // The body has no other velocity, and a simulated reference measures the true heading.
            Self::HeadingOffset(slot) => slot.write(&0.0, x),
            Self::Drift(slot) => slot.write(&Vector3::zeros(), x),
            Self::GyroBias(_) | Self::AccelBias(_) | Self::GyroScale(_) | Self::AccelScale(_) => {}
        }
    }

    /// How the world gives a block its value; `None` for a parameter, whose declaration gives it.
    pub(in super::super) fn of(layout: &Layout, block: &Block) -> Result<Option<Self>, BuildError> {
        match KNOWN.iter().find(|(name, _)| *name == block.name) {
            Some((_, handle)) => handle(layout).map(Some).map_err(|e| BuildError::new(e.to_string())),
            None if block.role != StateRole::Kinematic => Ok(None),
            None => {
                let names = KNOWN.map(|(name, _)| name);
                let message = format!(
                    "a simulated world does not know the true `{}`, which the process moves{}",
                    block.name,
                    did_you_mean(&block.name, &names).map_or_else(String::new, |meant| format!("; did you mean `{meant}`?"))
                );
                Err(BuildError::new(message).help(format!("it knows `{}`", names.join("`, `"))))
            }
        }
    }
}

/// A block whose value comes from its declaration alone; it moves by its own dynamics.
#[derive(Debug)]
struct Parameter {
    kind: Kind,
    storage: Range<usize>,
    dynamics: Dynamics,
    /// Of an integral: the range of its rate.
    rate: Option<Range<usize>>,
    random: Random,
}

/// A part of another vessel's pose, with its slot in the state.
#[derive(Debug)]
enum Pose {
    Position(Slot<Geodetic>),
    Attitude(Slot<Attitude>),
}

impl Pose {
    /// The part of a vessel's pose that a block is: `SENSOR.position` on the Earth, or `SENSOR.attitude` if the layout
    /// also has that position.
    fn of(layout: &Layout, block: &Block) -> Option<Self> {
        let (vessel, part) = block.name.rsplit_once('.')?;
        let place = layout.slot(QuantityName::<Geodetic>::new(&format!("{vessel}.{}", state::POSITION.as_str())));
        match (place, part) {
            (Ok(place), part) if part == state::POSITION.as_str() => Some(Self::Position(place)),
            (Ok(_), part) if part == state::ATTITUDE.as_str() => {
                layout.slot(QuantityName::<Attitude>::new(&block.name)).ok().map(Self::Attitude)
            }
            _ => None,
        }
    }
}

/// Whether the block is a current that a log measures against.
fn is_current(block: &Block) -> bool {
    let name = block.name.rsplit_once('.').map(|(_, name)| name);
    name == Some(parameter::CURRENT) && block.kind == Kind::Vector(3)
}

/// The range of the block that an integral integrates.
fn rate_of(layout: &Layout, block: &Block) -> Option<Range<usize>> {
    let Dynamics::Integral { rate, .. } = &block.dynamics else {
        return None;
    };
    layout.block(rate).map(Block::storage_range)
}

/// The rate of the heading \[rad/s\].
fn yaw_rate(truth: &Truth, gravity: Gravity) -> f64 {
    let nav = &truth.nav;
    let w_in = match gravity {
        Gravity::Flat(_) => Vector3::zeros(),
        _ => {
            let earth = LocalEarth::at(&nav.position);
            earth.earth_rate_n() + earth.transport_rate_n(&nav.v_eb_n)
        }
    };
    let rpy = so3::to_rpy(&nav.q_nb);
    let w_nb_b = truth.imu.rate - nav.q_nb.inverse_transform_vector(&w_in);
    (so3::euler_rate_of_body(rpy.x, rpy.y) * w_nb_b).z
}

/// The platform whose pose a block is, by the name of the sensor, or else the ship.
fn vessel<'a>(spec: &'a SimulationSpec, block: &'a Block) -> Result<(Option<&'a str>, &'a ShipSpec), BuildError> {
    let own = spec
        .platform
        .get(&block.owner)
        .map(|platform| (Some(block.owner.as_str()), platform));
    own.or_else(|| spec.ship.as_ref().map(|ship| (None, ship)))
        .ok_or_else(|| no_ship(block))
}

/// A vessel's pose is a state, but the world has no vessel. The initial 1σ of such a state means that nothing is known
/// yet; it does not say where a ship may be.
fn no_ship(block: &Block) -> BuildError {
    let message = format!(
        "the sensor `{}` measures the pose of a ship, and there is none in the simulated world",
        block.owner
    );
    let help = "add `ship = { position = [\"20 m\", \"10 m\", \"-20 m\"], heading = \"60 deg\" }` under [simulation]: north, east and down \
                of the origin of the run";
    BuildError::new(message).help(help)
}

impl TrueState {
    pub(super) fn new(setup: &Setup<'_>, spec: &SimulationSpec, seed: u64) -> Result<Self, BuildError> {
        let layout = setup.layout;
        let mut x = layout.initial().to_vec();
        let (mut known, mut currents, mut parameters, mut undrawn) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut ships = Vec::new();
        let sea = spec.sea.as_ref().filter(|sea| sea.has_current());
        let is_of_others = |block: &str| {
            block
                .split_once('.')
                .is_some_and(|(owner, _)| setup.others.iter().any(|o| o == owner))
        };
        let is_given = |block: &str| setup.given.iter().any(|given| given == block);
        for block in layout.blocks() {
            if let Some(k) = Known::of(layout, block)? {
                known.push(k);
            } else if let Some(pose) = Pose::of(layout, block).filter(|_| !is_of_others(&block.name)) {
                let (platform, ship) = vessel(spec, block)?;
                ships.push((Ship::new(ship, platform, setup.origin, seed), pose));
            } else if sea.is_some() && is_current(block) {
                currents.push(block.storage_range());
            } else if let Some(slip) = spec.true_slip(block) {
                x[block.storage_range()].fill(slip);
            } else if (spec.draw_parameters || rate_of(layout, block).is_some()) && !is_of_others(&block.name) {
                let mut random = Random::new(seed, &format!("state/{}", block.name));
                if !spec.draw_parameters {
                    undrawn.extend((!is_given(&block.name)).then(|| block.name.clone()));
                } else if !is_given(&block.name) {
                    let delta: Vec<f64> = block.sigma.iter().map(|sigma| sigma * random.normal()).collect();
                    block.kind.plus(&mut x[block.storage_range()], &delta);
                }
                let (kind, storage, mut dynamics) = (block.kind, block.storage_range(), block.dynamics.clone());
                if let (Dynamics::Integral { psd, .. }, false) = (&mut dynamics, spec.draw_parameters) {
                    // Its rate moves it, and nothing is drawn.
                    psd.fill(0.0);
                }
                parameters.push(Parameter {
                    kind,
                    storage,
                    dynamics,
                    rate: rate_of(layout, block),
                    random,
                });
            } else if !is_given(&block.name) {
                undrawn.push(block.name.clone());
            }
        }
        let part = |wanted: &Channel| match wanted {
            c if *c == channel::ANGULAR_RATE => Ok(InputPart::Rate),
            c if *c == channel::SPECIFIC_FORCE => Ok(InputPart::Force),
            c if *c == channel::FORWARD_SPEED => Ok(InputPart::Forward),
            c if *c == channel::SIDEWAYS_SPEED => Ok(InputPart::Sideways),
            c if *c == channel::YAW_RATE => Ok(InputPart::YawRate),
            c if *c == channel::ATTITUDE => Ok(InputPart::Attitude),
            other => Err(BuildError::at(
                "imu",
                format!("the process is driven by `{}`, which no simulated unit measures", other.name),
            )),
        };
        Ok(Self {
            x,
            signals: SignalBuffer::new(layout),
            process: setup.process.clone(),
            input: setup.input.iter().map(part).collect::<Result<_, _>>()?,
            sample: Vec::new(),
            frame: LocalFrame::new(setup.origin),
            gravity: setup.gravity,
            known,
            sea: sea.cloned(),
            currents,
            ships,
            parameters,
            undrawn,
            moved: Time::default(),
        })
    }

    /// The true state in storage order.
    pub(super) fn state(&self) -> &[f64] {
        &self.x
    }

    /// Whether the true value of a block comes from the world or a draw.
    pub(super) fn is_drawn(&self, block: &str) -> bool {
        !self.undrawn.iter().any(|name| name == block)
    }

    /// Where models are evaluated: the true state and the signals there.
    pub(super) fn view(&self) -> View<'_> {
        self.signals.view(&self.x)
    }

    /// Writes the truth into the state; `bias` and `scale` are the errors of the inertial unit.
    pub(super) fn fill(&mut self, truth: &Truth, bias: &Sample, scale: &Sample) {
        let (nav, x) = (&truth.nav, &mut self.x);
        // The process turns this input, with the states below, into the truth.
        let (mut rate_offset, mut force_offset) = (Vector3::zeros(), Vector3::zeros());
        for known in &self.known {
            known.write(truth, &self.frame, self.gravity, x);
            match known {
                Known::GyroBias(slot) => {
                    rate_offset += bias.rate;
                    slot.write(&bias.rate, x);
                }
                Known::AccelBias(slot) => {
                    force_offset += bias.force;
                    slot.write(&bias.force, x);
                }
                Known::GyroScale(slot) => {
                    rate_offset += scale.rate.component_mul(&truth.imu.rate);
                    slot.write(&scale.rate, x);
                }
                Known::AccelScale(slot) => {
                    force_offset += scale.force.component_mul(&truth.imu.force);
                    slot.write(&scale.force, x);
                }
                _ => {}
            }
        }
        if let Some(sea) = &self.sea {
            let current = sea.current(truth.time.seconds()).velocity;
            for block in &self.currents {
                x[block.clone()].copy_from_slice(current.as_slice());
            }
        }
        for (ship, pose) in &self.ships {
            let (place, attitude) = ship.pose(truth.time);
            match pose {
                Pose::Position(slot) => slot.write(&place, x),
                Pose::Attitude(slot) => slot.write(&attitude, x),
            }
        }
        self.sample.clear();
        let v_b = nav.q_nb.inverse_transform_vector(&nav.v_eb_n);
        for part in &self.input {
            let true_part = match part {
                InputPart::Forward => {
                    self.sample.push(v_b.x);
                    continue;
                }
                InputPart::Sideways => {
                    self.sample.push(v_b.y);
                    continue;
                }
                InputPart::YawRate => {
                    self.sample.push(yaw_rate(truth, self.gravity));
                    continue;
                }
                InputPart::Rate => truth.imu.rate + rate_offset,
                InputPart::Force => truth.imu.force + force_offset,
                InputPart::Attitude => {
                    let at = self.sample.len();
                    self.sample.resize(at + <Attitude as Manifold>::KIND.storage(), 0.0);
                    Attitude::write(&nav.q_nb, &mut self.sample[at..]);
                    continue;
                }
            };
            self.sample.extend_from_slice(true_part.as_slice());
        }
        self.signals
            .evaluate(self.process.as_ref(), &self.x, &Input::held(&self.sample), false);
    }

    /// Moves the parameters by their own dynamics; at the instants of one stream, so that other
    /// streams do not change them.
    pub(super) fn move_parameters(&mut self, to: Time) {
        let dt = to.seconds_since(self.moved);
        if dt <= 0.0 {
            return;
        }
        self.moved = to;
        for Parameter {
            kind,
            storage,
            dynamics,
            rate,
            random,
        } in &mut self.parameters
        {
            for (to, from) in storage.clone().zip(rate.iter().cloned().flatten()) {
                self.x[to] += dt * self.x[from];
            }
            let x = &mut self.x[storage.clone()];
            match dynamics {
                Dynamics::GaussMarkov { sigma, tau } => {
                    let decay = math::exp(-dt / *tau);
                    for (x, sigma) in x.iter_mut().zip(sigma) {
                        *x = decay * *x + *sigma * math::sqrt(1.0 - decay * decay) * random.normal();
                    }
                }
                Dynamics::RandomWalk { psd } | Dynamics::Integral { psd, .. } => {
                    let delta: Vec<f64> = psd.iter().map(|psd| math::sqrt(psd * dt) * random.normal()).collect();
                    kind.plus(x, &delta);
                }
                Dynamics::Process | Dynamics::Constant => {}
            }
        }
    }
}
