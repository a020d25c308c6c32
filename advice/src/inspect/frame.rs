//! A velocity `vx vy vz` without a unit and without named axes: along the body, as of a Doppler log, or along the world.
//!
//! The velocity v of the positions decides, where the vehicle moves: along north and east (x, y) = (v_n, v_e), along east
//! and north (x, y) = (v_e, v_n), and along the body (x, y) = (|v|, 0), or a number of quarter turns from there. The axes
//! are those that leave the smallest part of v unexplained.
//!
//! Not here: a frame that is turned by any other angle, and a body that moves sideways

use super::log::Log;
use super::names::is_derived;
use super::numbers::{Integral, line};
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
    /// The vehicle moves along x, y, −x, −y.
    Body(u8),
}

impl Axes {
    const ALL: [Self; 6] = [
        Self::NorthEast,
        Self::EastNorth,
        Self::Body(0),
        Self::Body(1),
        Self::Body(2),
        Self::Body(3),
    ];

    /// x and y of a velocity north, east.
    fn of(self, v: [f64; 2]) -> [f64; 2] {
        match self {
            Self::NorthEast => v,
            Self::EastNorth => [v[1], v[0]],
            Self::Body(quarter) => {
                let speed = math::hypot(v[0], v[1]);
                [[speed, 0.0], [0.0, speed], [-speed, 0.0], [0.0, -speed]][usize::from(quarter)]
            }
        }
    }
}

/// Takes columns `vx vy vz` for a velocity in the axes that the track shows. Returns true if it is one of the world.
/// `depth` tells whether z of a body is up.
pub(super) fn settle(log: &mut Log, track: &Track, depth: Option<&Depths>) -> bool {
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
    let world = |columns, said: &str| (Kind::Velocity, columns, said.to_owned());
    let (kind, columns, said) = match axes {
        Axes::NorthEast => world([(x, false), (y, false), (z, false)], "x, y, z as north, east, down"),
        Axes::EastNorth => world([(y, false), (x, false), (z, true)], "x, y, z as east, north, up"),
        Axes::Body(quarter) => {
            let is_up = depth.is_some_and(|depth| depth.rises_with(log.stamps(), values(z)));
            let ([ahead, side], name) = [
                ([(x, false), (y, is_up)], "x"),
                ([(y, false), (x, !is_up)], "y"),
                ([(x, true), (y, !is_up)], "-x"),
                ([(y, true), (x, is_up)], "-y"),
            ][usize::from(quarter)];
            let of_z = if is_up { "; up is z, for it runs against the depth" } else { "" };
            let said = format!("forward is {name}, the speed of the positions{of_z}");
            (Kind::BodyVelocity, [ahead, side, (z, is_up)], said)
        }
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

/// A depth over time \[m\].
#[derive(Debug)]
pub(super) struct Depths {
    t: Vec<f64>,
    values: Vec<f64>,
}

impl Depths {
    pub(super) fn of(log: &Log) -> Option<Self> {
        let values = log.values(Kind::Depth)?.into_iter().map(|v| v[0]).collect();
        log.clock.is_some().then(|| Self {
            t: log.stamps().to_vec(),
            values,
        })
    }

    /// Whether the depth changes against a vertical velocity.
    fn rises_with(&self, t: &[f64], z: &[f64]) -> bool {
        /// The depth changes by more than its noise over this time \[s\].
        const STRIDE: f64 = 5.0;
        /// The correlation r of n pairs is by chance below −4/√n once in thirty thousand times.
        const CHANCE: f64 = 4.0;
        let vertical = Integral::of(t, &z.iter().map(|z| [*z, 0.0, 0.0]).collect::<Vec<_>>());
        let (mut from, mut pairs) = (0, Vec::new());
        for to in 1..self.t.len() {
            let lasted = self.t[to] - self.t[from];
            if lasted < STRIDE {
                continue;
            }
            let change = (self.values[to] - self.values[from]) / lasted;
            if let Some(mean) = vertical
                .mean(self.t[from], self.t[to])
                .filter(|mean| change.is_finite() && mean[0].is_finite())
            {
                pairs.push((change, mean[0]));
            }
            from = to;
        }
        line(&pairs).1 * math::sqrt(pairs.len() as f64) < -CHANCE
    }
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
    fn z_is_up_if_it_runs_against_the_depth() {
        let t: Vec<f64> = (0..1500).map(|k| 0.2 * f64::from(k)).collect();
        let noise = |k: f64| 0.05 * (12.9898 * k).sin();
        let depth = Depths {
            values: t.iter().map(|t| 3.0 * (0.05 * t).sin() + noise(*t)).collect(),
            t: t.clone(),
        };
        let z = |sign: f64| {
            t.iter()
                .map(|t| sign * 0.15 * (0.05 * t).cos() + noise(t + 0.1))
                .collect::<Vec<_>>()
        };
        assert!(depth.rises_with(&t, &z(-1.0)) && !depth.rises_with(&t, &z(1.0)) && !depth.rises_with(&t, &z(0.0)));
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
