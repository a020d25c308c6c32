//! The values that a caller in C reads, as `fusion.h` declares them.

use fusion_vehicle::fusion_core::health;
use fusion_vehicle::fusion_models::solution::{Solution, sigmas};
use fusion_vehicle::nalgebra::Vector3;

/// The result of a call.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It did what it says.
    Ok = 0,
    /// `fusion_init` was not called.
    NotInitialised = 1,
    /// `fusion_init` was called before.
    AlreadyInitialised = 2,
    /// The filter waits for the data of its start.
    NotStarted = 3,
    /// There is no such stream.
    NoStream = 4,
    /// A row of this stream has another width.
    Width = 5,
    /// A pointer is null, or the block of memory is empty.
    Null = 6,
    /// Another call has not returned.
    Busy = 7,
    /// The bytes are no checkpoint of this design, or are damaged.
    Checkpoint = 8,
    /// Nothing can have measured these numbers, such as a latitude in degrees: the row is not used.
    Impossible = 9,
}

/// Position, velocity and attitude at one instant.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// The instant \[ns\], in the time of the stamps.
    pub time: i64,
    /// Latitude, longitude \[rad\] and height over the ellipsoid \[m\].
    pub position: [f64; 3],
    /// 1σ north, east, down \[m\].
    pub position_sigma: [f64; 3],
    /// Velocity north, east, down \[m/s\].
    pub velocity: [f64; 3],
    /// 1σ of it \[m/s\].
    pub velocity_sigma: [f64; 3],
    /// The quaternion q_nb: w, x, y, z. It turns body axes to north, east, down.
    pub attitude: [f64; 4],
    /// 1σ of the attitude about the body axes x, y, z \[rad\].
    pub attitude_sigma: [f64; 3],
    /// Which of them the filter has: 1 position, 2 velocity, 4 attitude. The others are zero.
    pub has: u32,
    /// 0 good, 1 aligning, 2 coasting without input, 3 degraded, 4 lost.
    pub health: u32,
}

impl State {
    pub(crate) fn new(solution: &Solution, health: health::State) -> Self {
        let mut state = Self {
            time: solution.time.nanos(),
            health: match health {
                health::State::Good => 0,
                health::State::Aligning => 1,
                health::State::Coasting => 2,
                health::State::Degraded => 3,
                health::State::Lost => 4,
            },
            ..Self::default()
        };
        if let Some((place, p)) = &solution.position {
            state.position = [place.lat, place.lon, place.height];
            state.position_sigma = array(sigmas(p));
            state.has |= 1;
        }
        if let Some((v, p)) = &solution.velocity {
            state.velocity = array(*v);
            state.velocity_sigma = array(sigmas(p));
            state.has |= 2;
        }
        if let Some((q, p)) = &solution.attitude {
            state.attitude = [q.w, q.i, q.j, q.k];
            state.attitude_sigma = array(sigmas(p));
            state.has |= 4;
        }
        state
    }
}

fn array(v: Vector3<f64>) -> [f64; 3] {
    v.into()
}
