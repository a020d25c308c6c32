//! The attitude errors of a run, with or without removal of the mean rotation between the two bodies.

use super::bounded::{Quantiles, Thinned};
use super::comparison::{AttitudeError, Deviation, attitude_error};
use super::scorer::Sums;
use super::{Axes, LengthSpread};
use fusion_core::geometry::so3;
use fusion_core::math;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// Roll and yaw are not judged above this pitch \[rad\]. There they rotate about nearly the same axis. A small tilt
/// then makes errors of both that are 1/cos 80° = 6 times as large, and no longer linear in the tilt.
const STEEP: f64 = 80.0 * core::f64::consts::PI / 180.0;

/// Collects attitudes as they arrive.
#[derive(Clone, Debug, Default)]
pub(super) struct Attitudes {
    removes_mounting: bool,
    count: u64,
    /// Epochs whose roll and yaw are not judged.
    steep: u64,
    /// Roll, pitch, yaw \[deg\], if no mounting is removed.
    sums: Sums,
    turns: Turns,
    /// The epochs if a mounting is removed: it is known only at the end. Above 2^16 epochs every second, fourth, … is
    /// kept.
    kept: Thinned<Kept>,
    /// The mounting is the mean from this time on \[s\].
    aligned: Option<f64>,
}

/// The data of an epoch for removing the mounting.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    time: Time,
    estimate: UnitQuaternion<f64>,
    truth: UnitQuaternion<f64>,
    /// 1σ of roll, pitch, yaw \[deg\].
    sigma: Vector3<f64>,
    is_estimated: [bool; 3],
}

/// Sums of squared rotations \[rad²\].
#[derive(Clone, Debug, Default)]
struct Turns {
    whole: f64,
    heading: f64,
    inclination: f64,
    /// The angle between the attitudes, and the rotation about the vertical \[rad\].
    angles: Quantiles,
    headings: Quantiles,
}

/// The errors of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Roll, pitch, yaw \[deg\].
    pub(super) axes: Option<Axes>,
    /// The mounting that was removed, roll pitch yaw \[deg\].
    pub(super) mounting_deg: Option<[f64; 3]>,
    /// The same as a rotation, from body to the reference's body.
    pub(super) mounting: UnitQuaternion<f64>,
    /// Median and 95 % of the angle between the attitudes, and of the rotation about the vertical \[deg\].
    pub(super) rotation_spread: Option<LengthSpread>,
    pub(super) heading_spread: Option<LengthSpread>,
    /// RMS of the angle between the attitudes \[deg\].
    pub(super) rotation: Option<f64>,
    /// RMS of the rotation about the vertical, and of the rest \[deg\].
    pub(super) heading: Option<f64>,
    pub(super) inclination: Option<f64>,
    /// Epochs whose roll and yaw are not judged.
    pub(super) steep: u64,
}

fusion_core::memory!(Attitudes { count, steep, sums, turns, kept; removes_mounting, aligned });
fusion_core::memory!(Kept {
    time,
    estimate,
    truth,
    sigma,
    is_estimated
});
fusion_core::memory!(Turns {
    whole,
    heading,
    inclination,
    angles,
    headings
});

impl Turns {
    /// The attitude error `e`, resolved in navigation axes.
    fn add(&mut self, e: &UnitQuaternion<f64>) {
        let [heading, inclination] = swing_and_twist(e);
        let whole = so3::log(e).norm();
        self.whole += whole * whole;
        self.angles.add(whole);
        self.headings.add(heading);
        self.heading += heading * heading;
        self.inclination += inclination * inclination;
    }
}

impl Attitudes {
    pub(super) fn new(removes_mounting: bool) -> Self {
        Self {
            removes_mounting,
            ..Self::default()
        }
    }

    /// The number of epochs so far.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn add(&mut self, time: Time, a: &AttitudeError) {
        self.count += 1;
        let mut degrees = in_degrees(&a.rpy);
        if is_steep(&a.estimate) || is_steep(&a.truth) {
            self.steep += 1;
            degrees.known = PITCH_ALONE;
            degrees.error = Vector3::y() * degrees.error.y;
        }
        if self.removes_mounting {
            self.kept.push(Kept {
                time,
                estimate: a.estimate,
                truth: a.truth,
                sigma: degrees.sigma(),
                is_estimated: degrees.is_estimated(),
            });
        } else {
            self.sums.add(time, &degrees);
            self.turns.add(&(a.estimate * rotation_of([0.0; 3]) * a.truth.inverse()));
        }
    }

    /// The filter reports that it was not aligned before this time \[s\]: earlier attitudes do not count for the
    /// mounting.
    pub(super) const fn align(&mut self, time: Option<f64>) {
        self.aligned = time;
    }

    pub(super) fn finish(self) -> Found {
        let kept = self.kept.rows();
        if !self.removes_mounting {
            return Found {
                steep: self.steep,
                ..Found::of(self.sums, self.turns, self.count as f64, None)
            };
        }
        let is_aligned = |k: &&Kept| self.aligned.is_none_or(|from| k.time.seconds() >= from);
        // A filter that was aligned after the last epoch uses the mounting of all epochs.
        let aligned = kept.iter().position(|k| is_aligned(&k)).unwrap_or_default();
        let mounting = mean_rotation(kept[aligned..].iter().map(|k| k.estimate.inverse() * k.truth));
        let mounting_deg: [f64; 3] = so3::to_rpy(&mounting).map(f64::to_degrees).into();
        let shown = rotation_of(mounting_deg);
        let (mut sums, mut turns, mut steep) = (Sums::default(), Turns::default(), 0);
        for k in kept {
            let estimate = k.estimate * mounting;
            let error = attitude_error(&estimate, &k.truth).map(f64::to_degrees);
            if is_steep(&estimate) || is_steep(&k.truth) {
                steep += 1;
                let is_estimated = [false, k.is_estimated[1], false];
                sums.add_error(k.time, &(Vector3::y() * error.y), &k.sigma, PITCH_ALONE, is_estimated);
            } else {
                sums.add_error(k.time, &error, &k.sigma, [true; 3], k.is_estimated);
            }
            turns.add(&(k.estimate * shown * k.truth.inverse()));
        }
        Found {
            steep,
            ..Found::of(sums, turns, kept.len() as f64, Some(mounting_deg))
        }
    }
}

impl Found {
    fn of(sums: Sums, mut turns: Turns, count: f64, mounting_deg: Option<[f64; 3]>) -> Self {
        let degrees = |of: &mut Quantiles| LengthSpread::of(of).map(|spread| spread.times(1_f64.to_degrees()));
        let rms = |squares: f64| (count > 0.0).then(|| math::sqrt(squares / count).to_degrees());
        Self {
            axes: sums.axes(),
            mounting_deg,
            mounting: mounting_deg.map(rotation_of).unwrap_or_default(),
            rotation_spread: degrees(&mut turns.angles),
            heading_spread: degrees(&mut turns.headings),
            rotation: rms(turns.whole),
            heading: rms(turns.heading),
            inclination: rms(turns.inclination),
            steep: 0,
        }
    }
}

/// The axes that are judged if roll and yaw are not.
const PITCH_ALONE: [bool; 3] = [false, true, false];

/// Returns true if roll and yaw rotate about nearly the same axis.
fn is_steep(q: &UnitQuaternion<f64>) -> bool {
    so3::to_rpy(q).y.abs() > STEEP
}

/// The rotation given by roll, pitch, yaw \[deg\].
fn rotation_of(rpy_deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
    so3::from_rpy(roll, pitch, yaw)
}

/// Splits the rotation `e` between two attitudes, resolved in navigation axes: the smallest rotation about the
/// vertical, and the remaining rotation about a level axis \[rad\].
pub(super) fn swing_and_twist(e: &UnitQuaternion<f64>) -> [f64; 2] {
    // atan2 instead of acos √(w² + z²), which is inaccurate near 0.
    [
        2.0 * math::atan2(e.k.abs(), e.w.abs()),
        2.0 * math::atan2(math::hypot(e.i, e.j), math::hypot(e.w, e.k)),
    ]
}

/// The rotation with the least mean squared angle to all `rotations`.
fn mean_rotation(rotations: impl Iterator<Item = UnitQuaternion<f64>> + Clone) -> UnitQuaternion<f64> {
    let mut mean = rotations.clone().next().unwrap_or_default();
    // The intrinsic mean; each pass squares the remaining error.
    for _ in 0..10 {
        let inverse = mean.inverse();
        let (count, sum) = rotations
            .clone()
            .fold((0.0, Vector3::zeros()), |(n, s), r| (n + 1.0, s + so3::log(&(inverse * r))));
        mean *= so3::exp(&(sum / f64::max(count, 1.0)));
    }
    mean
}

/// Converts an error from radians.
fn in_degrees(d: &Deviation) -> Deviation {
    let degree = 1_f64.to_degrees();
    Deviation {
        error: d.error * degree,
        own: d.own * (degree * degree),
        reference: d.reference * (degree * degree),
        known: d.known,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roll_and_yaw_are_not_judged_where_the_nose_points_up() {
        use nalgebra::Matrix3;
        let tilt = so3::exp(&Vector3::new(0.01, 0.0, 0.0));
        let of = |removes_mounting: bool, from: i32| {
            let mut attitudes = Attitudes::new(removes_mounting);
            for k in from..=17 {
                let truth = so3::from_rpy(0.3, f64::from(5 * k).to_radians(), 0.0);
                // The tilt is about a rotating navigation axis, so it is not a mounting.
                let turned = so3::from_rpy(0.0, 0.0, f64::from(k));
                let estimate = turned * tilt * turned.inverse() * truth;
                let (error, own) = (attitude_error(&estimate, &truth), Matrix3::identity() * 1e-4);
                let rpy = Deviation {
                    error,
                    own,
                    known: [true; 3],
                    ..Deviation::default()
                };
                attitudes.add(
                    Time::default(),
                    &AttitudeError {
                        estimate,
                        truth,
                        body: Deviation::default(),
                        rpy,
                    },
                );
            }
            attitudes.finish()
        };
        for removes_mounting in [false, true] {
            let found = of(removes_mounting, 0);
            let axes = found.axes.unwrap();
            // The epochs at 85°, and one at 80° that the error lifts above it. At 75°, 0.01 rad become 0.01 tan 75° =
            // 2.1°.
            assert!((1..=2).contains(&found.steep), "{}", found.steep);
            assert!(axes.max[0] < 3.6 && axes.max[2] < 3.6 && axes.max[1] < 0.6, "{axes:?}");
            // 1σ of 0.01 rad about a body axis: the tilt is always within 3σ.
            assert!((found.inclination.unwrap() - 0.573).abs() < 0.2, "{found:?}");
            // If every epoch is steep, there is no result for roll and yaw.
            let steep = of(removes_mounting, 17).axes.unwrap();
            assert!(steep.rms[0].is_nan() && steep.rms[2].is_nan() && steep.rms[1] < 0.6, "{steep:?}");
        }
    }

    #[test]
    fn a_mounting_is_of_the_time_since_the_filter_was_aligned() {
        let mounting = so3::from_rpy(0.01, -0.02, 0.03);
        let of = |aligned: Option<f64>| {
            let mut attitudes = Attitudes::new(true);
            for k in 0..20 {
                let truth = so3::from_rpy(0.1, 0.2, f64::from(k));
                let wrong = so3::from_rpy(0.0, 0.0, if k < 5 { 1.0 } else { 0.0 });
                let a = AttitudeError {
                    estimate: wrong * truth * mounting.inverse(),
                    truth,
                    body: Deviation::default(),
                    rpy: Deviation::default(),
                };
                attitudes.add(Time::from_seconds(f64::from(k)), &a);
            }
            attitudes.align(aligned);
            attitudes.finish().mounting.angle_to(&mounting)
        };
        // 1e-12: rounding of the mean.
        assert!(of(Some(5.0)) < 1e-12);
        // A quarter of one radian, if it was never aligned or after the last epoch.
        assert!(of(None) > 0.2 && of(Some(100.0)) > 0.2);
    }

    #[test]
    fn a_turn_splits_into_heading_and_inclination() {
        let (level, down) = (Vector3::new(0.6, 0.8, 0.0), Vector3::z());
        for (tilt, turn) in [(0.0, 0.0), (1e-9, 0.4), (0.3, -3.0), (-1.2, 0.7)] {
            let e = so3::exp(&(level * tilt)) * so3::exp(&(down * turn));
            let [heading, inclination] = swing_and_twist(&e);
            // 1e-15: rounding; by acos it would be 1e-8.
            assert!(
                (heading - f64::abs(turn)).abs() < 1e-15 && (inclination - f64::abs(tilt)).abs() < 1e-15,
                "{heading} {inclination}"
            );
        }
        let truth = so3::from_rpy(0.5, -0.2, 2.0);
        let mut attitudes = Attitudes::new(false);
        for turn in [0.03, -0.04] {
            attitudes.add(
                Time::default(),
                &AttitudeError {
                    estimate: so3::exp(&(down * turn)) * truth,
                    truth,
                    body: Deviation::default(),
                    rpy: Deviation::default(),
                },
            );
        }
        let found = attitudes.finish();
        // √((9 + 16)/2)·1e-2 rad; 1e-12: rounding.
        assert!((found.heading.unwrap() - (12.5_f64.sqrt() * 1e-2).to_degrees()).abs() < 1e-12);
        assert!(found.inclination.unwrap() < 1e-12);
    }
}
