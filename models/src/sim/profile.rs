//! Smooth profiles: how one value passes into another with finite jerk.
//!
//! [`step5`]    0 → 1 with two vanishing derivatives at both ends, for speeds
//! [`step7`]    0 → 1 with three, for positions
//! [`Turn`]     0 → 1 at a steady rate between two smooth ramps, for angles
//! [`pulse`]    there and back: 0 → +1 → −1 → 0, three vanishing derivatives at both ends
//! [`Along`]    progress along a path: speed up, cruise, slow down

use crate::block::BuildError;
use fusion_core::math;

/// A value and its first two derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Jet {
    pub(super) value: f64,
    pub(super) first: f64,
    pub(super) second: f64,
}

impl Jet {
    /// The same value as a function of t where the argument was t/`duration`, times `size`.
    pub(super) fn stretched(self, size: f64, duration: f64) -> Self {
        Self {
            value: self.value * size,
            first: self.first * size / duration,
            second: self.second * size / (duration * duration),
        }
    }
}

/// The greatest slope of [`step5`].
const STEP5_SLOPE: f64 = 1.875;

/// 6u⁵ − 15u⁴ + 10u³ on \[0, 1\].
pub(super) fn step5(u: f64) -> Jet {
    let u = u.clamp(0.0, 1.0);
    let (u2, v) = (u * u, 1.0 - u);
    Jet {
        value: u2 * u * (10.0 + u * (6.0 * u - 15.0)),
        first: 30.0 * u2 * v * v,
        second: 60.0 * u * v * (1.0 - 2.0 * u),
    }
}

/// ∫ of [`step5`] from 0 to `u`; 1/2 at 1.
fn step5_integral(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    math::powi(u, 4) * (2.5 + u * (u - 3.0))
}

/// −20u⁷ + 70u⁶ − 84u⁵ + 35u⁴ on \[0, 1\].
pub(super) fn step7(u: f64) -> Jet {
    let u = u.clamp(0.0, 1.0);
    let (u2, v) = (u * u, 1.0 - u);
    Jet {
        value: u2 * u2 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u))),
        first: 140.0 * math::powi(u * v, 3),
        second: 420.0 * math::powi(u * v, 2) * (1.0 - 2.0 * u),
    }
}

/// The third derivative of [`step7`].
pub(super) fn step7_third(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    let (uv, slope) = (u * (1.0 - u), 1.0 - 2.0 * u);
    840.0 * uv * (slope * slope - uv)
}

/// sin 2πu sin²πu over its maximum, and its integral, on \[0, 1\].
pub(super) fn pulse(u: f64) -> (f64, Jet) {
    use core::f64::consts::{PI, TAU};
    const SCALE: f64 = 1.539_600_717_839_002; // 8/(3√3)
    let u = u.clamp(0.0, 1.0);
    let (s, c) = math::sin_cos(PI * u);
    let integral = SCALE * math::powi(s, 4) / TAU;
    let value = SCALE * 2.0 * math::powi(s, 3) * c;
    let first = SCALE * TAU * s * s * (3.0 * c * c - s * s);
    let second = SCALE * TAU * PI * 2.0 * s * c * (3.0 * c * c - 5.0 * s * s);
    (integral, Jet { value, first, second })
}

/// From 0 to 1 over \[0, 1\]: the rate ramps up over a quarter, holds, ramps down over a quarter.
pub(super) struct Turn;

impl Turn {
    /// The share of each ramp.
    pub(super) const RAMP: f64 = 0.25;
    /// The steady rate, as a multiple of the mean one.
    pub(super) const PEAK: f64 = 1.0 / (1.0 - Self::RAMP);

    pub(super) fn at(u: f64) -> Jet {
        let u = u.clamp(0.0, 1.0);
        if u > 0.5 {
            let mirrored = Self::at(1.0 - u);
            return Jet {
                value: 1.0 - mirrored.value,
                first: mirrored.first,
                second: -mirrored.second,
            };
        }
        let rate = step5(u / Self::RAMP);
        let steady = (u - Self::RAMP).max(0.0);
        Jet {
            value: Self::PEAK * (Self::RAMP * step5_integral(u / Self::RAMP) + steady),
            first: Self::PEAK * rate.value,
            second: Self::PEAK * rate.first / Self::RAMP,
        }
    }
}

/// How far and how fast a run goes, as its spec says it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// Seconds, if stated.
    pub(super) duration: Option<f64>,
    /// Metres, if stated.
    pub(super) distance: Option<f64>,
    /// Speed to run at \[m/s\]; the present one where not stated.
    pub(super) speed: Option<f64>,
    /// Speed to end at \[m/s\]; the same where not stated.
    pub(super) end_speed: Option<f64>,
    /// Greatest acceleration \[m/s²\].
    pub(super) acceleration: f64,
}

/// Progress along a path: a change of speed, a cruise, another change of speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    speeds: [f64; 3],
    times: [f64; 3],
}

impl Along {
    /// The profile from speed `now` \[m/s\].
    pub(super) fn new(now: f64, wanted: Wanted) -> Result<Self, BuildError> {
        let cruise = wanted.speed.unwrap_or(now);
        let end = wanted.end_speed.unwrap_or(cruise);
        let change = |by: f64| STEP5_SLOPE * by.abs() / wanted.acceleration;
        let (up, down) = (change(cruise - now), change(end - cruise));
        let least = 0.5 * (now + cruise) * up + 0.5 * (cruise + end) * down;
        let steady = match (wanted.duration, wanted.distance) {
            (Some(duration), None) => {
                let steady = duration - up - down;
                if steady < 0.0 {
                    let takes = format!("too short: the changes of speed alone take {:.3} s", up + down);
                    return Err(BuildError::at("duration", takes).help("allow more time or more `acceleration`"));
                }
                steady
            }
            (None, Some(distance)) => {
                if cruise <= 0.0 {
                    let help = "state a `speed`; to stop at the end, `end_speed = 0`";
                    return Err(BuildError::at("speed", "no distance is covered at speed 0").help(help));
                }
                // The changes of speed may fill the distance exactly: a rounding below that is allowed.
                let rest = distance - least;
                if rest < -1e-9 * distance {
                    let takes = format!("too short: the changes of speed alone take {least:.3} m");
                    return Err(BuildError::at("distance", takes).help("allow more distance or more `acceleration`"));
                }
                rest.max(0.0) / cruise
            }
            _ => return Err(BuildError::at("distance", "state either `distance` or `duration`")),
        };
        Ok(Self {
            speeds: [now, cruise, end],
            times: [up, steady, down],
        })
    }

    pub(super) fn duration(&self) -> f64 {
        self.times.iter().sum()
    }

    pub(super) fn distance(&self) -> f64 {
        self.at(self.duration()).value
    }

    /// Distance, speed and acceleration after `t` seconds.
    pub(super) fn at(&self, t: f64) -> Jet {
        let [up, steady, down] = self.times;
        let [from, cruise, end] = self.speeds;
        let ramp = |from: f64, to: f64, duration: f64, t: f64| {
            let u = if duration > 0.0 { t / duration } else { 1.0 };
            let blend = step5(u);
            Jet {
                value: from * t + (to - from) * duration * step5_integral(u),
                first: from + (to - from) * blend.value,
                second: if duration > 0.0 {
                    (to - from) * blend.first / duration
                } else {
                    0.0
                },
            }
        };
        if t < up {
            return ramp(from, cruise, up, t);
        }
        let start = 0.5 * (from + cruise) * up;
        if t < up + steady || down <= 0.0 {
            return Jet {
                value: start + cruise * (t - up).min(steady),
                first: cruise,
                second: 0.0,
            };
        }
        let last = ramp(cruise, end, down, (t - up - steady).min(down));
        Jet {
            value: last.value + start + cruise * steady,
            ..last
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_derivatives(f: impl Fn(f64) -> Jet, until: f64) {
        let h = 1e-5 * until;
        for k in 1..100 {
            let u = until * f64::from(k) / 100.0;
            let (low, high, here) = (f(u - h), f(u + h), f(u));
            // 1e-6 of the size: truncation h²/6 times a few hundred, rounding ε/h.
            let first = (high.value - low.value) / (2.0 * h);
            assert!(
                (here.first - first).abs() < 1e-6 * (1.0 + first.abs()),
                "{u}: {} {first}",
                here.first
            );
            let second = (high.first - low.first) / (2.0 * h);
            assert!(
                (here.second - second).abs() < 1e-6 * (1.0 + second.abs()),
                "{u}: {} {second}",
                here.second
            );
        }
    }

    #[test]
    fn each_profile_is_the_integral_of_its_derivatives() {
        assert_derivatives(step5, 1.0);
        assert_derivatives(step7, 1.0);
        assert_derivatives(|u| pulse(u).1, 1.0);
        assert_derivatives(
            |u| Jet {
                value: pulse(u).0,
                first: pulse(u).1.value,
                second: pulse(u).1.first,
            },
            1.0,
        );
        assert_derivatives(Turn::at, 1.0);
        let wanted = Wanted {
            duration: None,
            distance: Some(50.0),
            speed: Some(2.0),
            end_speed: Some(0.5),
            acceleration: 0.3,
        };
        let along = Along::new(1.0, wanted).unwrap();
        assert_derivatives(|t| along.at(t), along.duration());
    }

    #[test]
    fn each_profile_starts_and_ends_where_it_says() {
        // 4 ε: rounding of the polynomials.
        let near = |a: f64, b: f64| (a - b).abs() < 4.0 * f64::EPSILON;
        for f in [step5, step7, Turn::at] {
            assert!(near(f(0.0).value, 0.0) && near(f(1.0).value, 1.0) && near(f(0.5).value, 0.5));
            assert!(near(f(0.0).first, 0.0) && near(f(1.0).first, 0.0));
            assert!(near(f(0.0).second, 0.0) && near(f(1.0).second, 0.0));
        }
        assert!(near(Turn::at(0.5).first, Turn::PEAK));
        // 2e-7: maximum found on a grid of 1e-4.
        let greatest = (0..10_000).map(|k| pulse(f64::from(k) * 1e-4).1.value).fold(0.0, f64::max);
        assert!((greatest - 1.0).abs() < 2e-7, "{greatest}");
    }

    #[test]
    fn a_run_covers_its_distance_within_its_acceleration() {
        let wanted = Wanted {
            duration: None,
            distance: Some(20.0),
            speed: Some(1.0),
            end_speed: Some(0.0),
            acceleration: 0.2,
        };
        let along = Along::new(0.0, wanted).unwrap();
        assert!((along.distance() - 20.0).abs() < 1e-14, "{}", along.distance()); // rounding
        let greatest = (0..3000).map(|k| along.at(f64::from(k) * 0.01).second.abs()).fold(0.0, f64::max);
        assert!(greatest <= 0.2 && greatest > 0.1999, "{greatest}"); // 1e-4: the grid
        assert!(
            Along::new(
                0.0,
                Wanted {
                    distance: Some(5.0),
                    ..wanted
                }
            )
            .is_err(),
            "9.4 m are needed"
        );
        assert!(
            Along::new(
                0.0,
                Wanted {
                    duration: Some(60.0),
                    ..wanted
                }
            )
            .is_err(),
            "both were stated"
        );
    }
}
