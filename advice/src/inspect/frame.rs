//! A velocity `vx vy vz` without a unit and without named axes: along the body, as of a Doppler log, or along the world.
//!
//! The velocity v of the positions decides, where the vehicle moves: along north and east (x, y) = (v_n, v_e), along east
//! and north (x, y) = (v_e, v_n), and along the body (x, y) = (|v|, 0). The axes are those that leave the smallest
//! part of v unexplained.
//!
//! Not here: a frame that is turned by any other angle, and a body that moves sideways

use super::log::Log;
use super::names::is_derived;
use super::signal::{Kind, Signal, UNNAMED};
use super::track::Track;
use super::words::{Words, is_called};
use fusion_core::math;

/// The axes leave at most this share of the squared velocity unexplained: half of the speed is noise or a current.
const EXPLAINED: f64 = 0.25;
/// Other axes leave more than that, and at least this number of times as much.
const OTHERS: f64 = 4.0;
/// Fewer velocities in motion are not enough.
const ENOUGH: usize = 20;
/// Rows further from a fix than this do not belong to it \[s\]: it is the interval of common receivers.
const NEAR: f64 = 1.0;

/// Axes of a velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axes {
    NorthEast,
    EastNorth,
    Body,
}

impl Axes {
    const ALL: [Self; 3] = [Self::NorthEast, Self::EastNorth, Self::Body];

    /// x and y of a velocity north, east.
    fn of(self, v: [f64; 2]) -> [f64; 2] {
        match self {
            Self::NorthEast => v,
            Self::EastNorth => [v[1], v[0]],
            Self::Body => [math::hypot(v[0], v[1]), 0.0],
        }
    }
}

/// Takes columns `vx vy vz` for a velocity in the axes that the track shows. Returns true if it is one of the world.
pub(super) fn settle(log: &mut Log, track: &Track) -> bool {
    let has_velocity = [Kind::Velocity, Kind::BodyVelocity, Kind::Speed]
        .into_iter()
        .any(|kind| log.has(kind));
    let Some(columns) = columns(log).filter(|_| log.clock.is_some() && !has_velocity) else {
        return false;
    };
    let values = |k: usize| &log.table.columns[k].values;
    let Some(axes) = axes(log.stamps(), values(columns[0]), values(columns[1]), track) else {
        return false;
    };
    let [x, y, z] = columns;
    let (kind, columns, said) = match axes {
        Axes::NorthEast => (Kind::Velocity, [(x, false), (y, false), (z, false)], "x, y, z as north, east, down"),
        Axes::EastNorth => (Kind::Velocity, [(y, false), (x, false), (z, true)], "x, y, z as east, north, up"),
        Axes::Body => (
            Kind::BodyVelocity,
            [(x, false), (y, false), (z, false)],
            "x, y, z as forward, right, down: x is the speed of the positions",
        ),
    };
    log.signals.push(Signal {
        of_height: "m",
        kind,
        columns: columns.to_vec(),
        unit: "m/s".to_owned(),
        factor: 1.0,
        increment: false,
        course: None,
        is_body: false,
        why: format!("by the velocity of the positions: {said}; {UNNAMED}"),
    });
    kind == Kind::Velocity
}

/// The columns `vx vy vz` that no quantity uses.
fn columns(log: &Log) -> Option<[usize; 3]> {
    let words: Vec<Words> = log.table.columns.iter().map(|column| Words::of(column.called())).collect();
    let is_free = |k: &usize| log.signals.iter().all(|signal| signal.columns.iter().all(|(used, _)| used != k));
    let of = |axis: &str| {
        let is_it = |k: &usize| {
            let before = words[*k].before(axis);
            before.is_some_and(|before| is_called(before, &["v", "vel", "velocity"])) && words[*k].unit.is_none()
        };
        let mut all = (0..words.len()).filter(|k| is_free(k) && is_it(k) && !is_derived(log.table.columns[*k].called()));
        all.next()
    };
    Some([of("x")?, of("y")?, of("z")?])
}

/// The axes along which a velocity fits the track; `None` if several fit, or none.
fn axes(t: &[f64], x: &[f64], y: &[f64], track: &Track) -> Option<Axes> {
    let pairs = track.moving().filter_map(|(at, v, _)| {
        let after = t.partition_point(|t| *t < at);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|k| *k < t.len());
        let k = near.min_by(|a, b| (t[*a] - at).abs().total_cmp(&(t[*b] - at).abs()))?;
        let is_near = (t[k] - at).abs() <= NEAR;
        (is_near && x[k].is_finite() && y[k].is_finite()).then_some((v, [x[k], y[k]]))
    });
    let pairs: Vec<([f64; 2], [f64; 2])> = pairs.collect();
    let all: f64 = pairs.iter().map(|(v, _)| v[0] * v[0] + v[1] * v[1]).sum();
    let left = |axes: Axes| {
        let parts = pairs.iter().map(|(v, own)| {
            let expected = axes.of(*v);
            math::powi(own[0] - expected[0], 2) + math::powi(own[1] - expected[1], 2)
        });
        parts.sum::<f64>() / all
    };
    let mut ranked = Axes::ALL.map(|axes| (axes, left(axes)));
    ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
    // On one straight line several fit, more or less.
    let is_clear = ranked[0].1 <= EXPLAINED && ranked[1].1 > EXPLAINED.max(OTHERS * ranked[0].1);
    (pairs.len() >= ENOUGH && is_clear).then_some(ranked[0].0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five minutes on a winding path, and a velocity in some axes with noise and a scale error of 3 %.
    fn found(own: impl Fn([f64; 2]) -> [f64; 2], turns: bool) -> Option<Axes> {
        let noise = |k: f64| 0.05 * (12.9898 * k).sin();
        let course = |t: f64| if turns { 1.5 * (0.05 * t).sin() + 0.02 * t } else { 0.7 };
        let velocity = |t: f64| [1.5 * course(t).cos(), 1.5 * course(t).sin()];
        let t: Vec<f64> = (0..1500).map(|k| 0.2 * f64::from(k)).collect();
        let xy = |i: usize| {
            t.iter()
                .map(|t| 1.03 * own(velocity(*t))[i] + noise(*t + i as f64))
                .collect::<Vec<_>>()
        };
        let stamps: Vec<f64> = (0..300).map(f64::from).collect();
        let track = Track {
            velocity: stamps.iter().map(|t| [velocity(*t)[0] + noise(*t), velocity(*t)[1], 0.0]).collect(),
            t: stamps,
            ..Track::default()
        };
        axes(&t, &xy(0), &xy(1), &track)
    }

    #[test]
    fn axes_are_those_that_the_positions_show() {
        for axes in Axes::ALL {
            assert_eq!(found(|v| axes.of(v), true), Some(axes));
        }
        // Turned by 50 degrees, it is neither; on one straight line to the north-east several fit.
        let turned = |v: [f64; 2]| [0.64 * v[0] - 0.77 * v[1], 0.77 * v[0] + 0.64 * v[1]];
        assert_eq!(found(turned, true), None);
        let diagonal = |v: [f64; 2]| [v[1], v[0]];
        assert_eq!(found(diagonal, false), None);
    }
}
