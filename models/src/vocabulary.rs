//! The well-known states, signals and channels: each name written once, with its type.
//!
//! A process provides those names of [`state`] that it has, as states or as signals. Sensors, stages, initialisers, the
//! simulator and the score find them by these constants. A block may add quantities under its own names. A [`channel`]
//! is a part of a stream, under the name of the quantity that it measures.

/// Names of states and signals, typed by the manifold of their values.
pub mod state {
    use fusion_core::state::{Angle, Attitude, Geodetic, Position, QuantityName, Scalar, Vector, Velocity};

    /// Geodetic position of the body.
    pub const POSITION: QuantityName<'static, Geodetic> = QuantityName::new("position");
    /// Position of the body, north, east, down of the origin of the run \[m\].
    pub const LOCAL_POSITION: QuantityName<'static, Position> = QuantityName::new("local_position");
    /// Velocity v_eb_n \[m/s\].
    pub const VELOCITY: QuantityName<'static, Velocity> = QuantityName::new("velocity");
    /// Attitude q_nb, body to north-east-down.
    pub const ATTITUDE: QuantityName<'static, Attitude> = QuantityName::new("attitude");
    /// Heading, clockwise from north \[rad\].
    pub const HEADING: QuantityName<'static, Angle> = QuantityName::new("heading");
    /// Speed along the heading \[m/s\].
    pub const SPEED: QuantityName<'static, Scalar> = QuantityName::new("speed");
    /// Rate of the heading \[rad/s\].
    pub const YAW_RATE: QuantityName<'static, Scalar> = QuantityName::new("yaw_rate");
    /// Speed sideways in a turn, divided by speed times yaw rate \[s\].
    pub const SIDE_SLIP: QuantityName<'static, Scalar> = QuantityName::new("side_slip");
    /// Velocity of the body over ground in its own axes, forward, right, down \[m/s\].
    pub const BODY_VELOCITY: QuantityName<'static, Vector<3>> = QuantityName::new("body_velocity");
    /// From the heading of a reference to the true heading, clockwise \[rad\].
    pub const HEADING_OFFSET: QuantityName<'static, Scalar> = QuantityName::new("heading_offset");
    /// Velocity that is not in the body's axes, north, east, down \[m/s\].
    pub const DRIFT: QuantityName<'static, Vector<3>> = QuantityName::new("drift");
    /// Angular rate w_ib_b, body axes \[rad/s\].
    pub const ANGULAR_RATE: QuantityName<'static, Vector<3>> = QuantityName::new("angular_rate");
    /// Acceleration dv_eb_n/dt \[m/s²\].
    pub const ACCELERATION: QuantityName<'static, Vector<3>> = QuantityName::new("acceleration");
    /// Gyro bias, body axes \[rad/s\].
    pub const GYRO_BIAS: QuantityName<'static, Vector<3>> = QuantityName::new("gyro_bias");
    /// Accelerometer bias, body axes \[m/s²\].
    pub const ACCEL_BIAS: QuantityName<'static, Vector<3>> = QuantityName::new("accel_bias");
    /// Scale factor errors of the gyros, body axes.
    pub const GYRO_SCALE: QuantityName<'static, Vector<3>> = QuantityName::new("gyro_scale");
    /// Scale factor errors of the accelerometers, body axes.
    pub const ACCEL_SCALE: QuantityName<'static, Vector<3>> = QuantityName::new("accel_scale");
}

/// Names of parameters whose truth a simulated world may know: a state of a sensor is named `sensor.parameter`.
pub mod parameter {
    /// The error that a sensor adds, in each row of its residual.
    pub const BIAS: &str = "bias";
    /// Velocity of the water over ground, north, east, down \[m/s\].
    pub const CURRENT: &str = "current";
    /// The share of their speed that the tracks of a vehicle lose.
    pub const SLIP: &str = "slip";
}

/// Channels of streams: name, width, dimension and shape.
#[cfg(feature = "declare")]
pub mod channel {
    use super::state;
    use crate::channel::Channel;
    use crate::units::{Dimensional, dim};

    /// Geodetic position.
    pub const POSITION: Channel = Channel::geodetic(state::POSITION.as_str());
    /// Latitude and longitude \[rad\], if the height is not known.
    pub const HORIZONTAL_POSITION: Channel = Channel::angles("horizontal_position", 2);
    /// Velocity north, east, down \[m/s\].
    pub const VELOCITY: Channel = Channel::vector(state::VELOCITY.as_str(), 3, dim::Speed::KIND.dimension);
    /// Velocity north and east \[m/s\], if the vertical velocity is not known.
    pub const HORIZONTAL_VELOCITY: Channel = Channel::vector("horizontal_velocity", 2, dim::Speed::KIND.dimension);
    /// Attitude as a unit quaternion, body to north-east-down.
    pub const ATTITUDE: Channel = Channel::quaternion(state::ATTITUDE.as_str());
    /// Heading, clockwise from north \[rad\].
    pub const HEADING: Channel = Channel::angle(state::HEADING.as_str());
    /// Angular rate, body axes \[rad/s\].
    pub const ANGULAR_RATE: Channel = Channel::vector(state::ANGULAR_RATE.as_str(), 3, dim::AngularRate::KIND.dimension);
    /// Specific force, body axes \[m/s²\].
    pub const SPECIFIC_FORCE: Channel = Channel::vector("specific_force", 3, dim::Acceleration::KIND.dimension);
    /// Acceleration dv_eb_n/dt \[m/s²\].
    pub const ACCELERATION: Channel = Channel::vector(state::ACCELERATION.as_str(), 3, dim::Acceleration::KIND.dimension);
    /// Speed ahead \[m/s\].
    pub const FORWARD_SPEED: Channel = Channel::vector("forward_speed", 1, dim::Speed::KIND.dimension);
    /// Speed to the right \[m/s\].
    pub const SIDEWAYS_SPEED: Channel = Channel::vector("sideways_speed", 1, dim::Speed::KIND.dimension);
    /// Rate of turn, clockwise seen from above \[rad/s\].
    pub const YAW_RATE: Channel = Channel::vector(state::YAW_RATE.as_str(), 1, dim::AngularRate::KIND.dimension);
    /// Magnetic field, body axes \[T\].
    pub const MAGNETIC_FIELD: Channel = Channel::vector("magnetic_field", 3, dim::MagneticField::KIND.dimension);

    /// Geodetic position of another vessel, such as the ship that carries a transceiver.
    pub const SHIP_POSITION: Channel = Channel::geodetic("ship_position");
    /// Its attitude as a unit quaternion, its body to north-east-down.
    pub const SHIP_ATTITUDE: Channel = Channel::quaternion("ship_attitude");
    /// Range and direction of a transponder, as an acoustic system measures them: slant range \[m\].
    pub const RANGE: Channel = Channel::vector("range", 1, dim::Length::KIND.dimension);
    /// Bearing from the transceiver's x axis towards its y axis \[rad\].
    pub const BEARING: Channel = Channel::angle("bearing");
    /// Depression below the transceiver's x-y plane, towards its z axis \[rad\].
    pub const DEPRESSION: Channel = Channel::angle("depression");
    /// Speed of the left track over ground \[m/s\].
    pub const LEFT_TRACK: Channel = Channel::vector("left", 1, dim::Speed::KIND.dimension);
    /// Speed of the right track over ground \[m/s\].
    pub const RIGHT_TRACK: Channel = Channel::vector("right", 1, dim::Speed::KIND.dimension);
    /// Velocity of the body in its own axes, forward, right, down \[m/s\].
    pub const BODY_VELOCITY: Channel = Channel::vector(state::BODY_VELOCITY.as_str(), 3, dim::Speed::KIND.dimension);

    /// Pseudorange of a satellite, corrected for the clock of the satellite \[m\].
    pub const PSEUDORANGE: Channel = Channel::vector("pseudorange", 1, dim::Length::KIND.dimension);
    /// Rate of the pseudorange, corrected for the drift of the clock of the satellite \[m/s\].
    pub const PSEUDORANGE_RATE: Channel = Channel::vector("pseudorange_rate", 1, dim::Speed::KIND.dimension);
    /// Position of the satellite at transmission, Earth-centred Earth-fixed axes of that time \[m\].
    pub const SATELLITE_POSITION: Channel = Channel::vector("satellite_position", 3, dim::Length::KIND.dimension);
    /// Its velocity relative to the Earth in the same axes \[m/s\].
    pub const SATELLITE_VELOCITY: Channel = Channel::vector("satellite_velocity", 3, dim::Speed::KIND.dimension);

    /// The channel with this name, if it is one of these.
    #[must_use]
    pub fn known(name: &str) -> Option<Channel> {
        let all = [
            POSITION,
            HORIZONTAL_POSITION,
            VELOCITY,
            HORIZONTAL_VELOCITY,
            ATTITUDE,
            HEADING,
            ANGULAR_RATE,
            SPECIFIC_FORCE,
            MAGNETIC_FIELD,
            ACCELERATION,
            FORWARD_SPEED,
            SIDEWAYS_SPEED,
            YAW_RATE,
            SHIP_POSITION,
            SHIP_ATTITUDE,
            BEARING,
            DEPRESSION,
            LEFT_TRACK,
            RIGHT_TRACK,
            BODY_VELOCITY,
            PSEUDORANGE,
            PSEUDORANGE_RATE,
            SATELLITE_POSITION,
            SATELLITE_VELOCITY,
        ];
        all.into_iter().find(|channel| channel.name == name)
    }
}
