//! The attitude errors of a run, the mean rotation between the two bodies taken out or not.

use super::bounded::{Quantiles, Thinned};
use super::comparison::{AttitudeError, Deviation, attitude_error};
use super::scorer::Sums;
use super::{Axes, Spread};
use fusion_core::geometry::so3;
use fusion_core::time::Time;
use nalgebra::{UnitQuaternion, Vector3};

/// Attitudes as they come.
#[derive(Clone, Debug, Default)]
pub(super) struct Attitudes {
    removes_mounting: bool,
    count: u64,
    /// Roll, pitch, yaw \[deg\], where no mounting is taken out.
    sums: Sums,
    turns: Turns,
    /// Where it is: it is known in the end. Of more than 2^16 epochs every second, fourth, … counts.
    kept: Thinned<Kept>,
}

/// What is needed of an epoch to take the mounting out.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    time: Time,
    estimate: UnitQuaternion<f64>,
    truth: UnitQuaternion<f64>,
    /// 1σ of roll, pitch, yaw \[deg\].
    sigma: Vector3<f64>,
    is_estimated: [bool; 3],
}

/// Sums of squared turns \[rad²\].
#[derive(Clone, Debug, Default)]
struct Turns {
    whole: f64,
    heading: f64,
    inclination: f64,
    /// Of the angle between the attitudes, and of the turn about the vertical \[rad\].
    angles: Quantiles,
    headings: Quantiles,
}

/// The errors of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Found {
    /// Roll, pitch, yaw \[deg\].
    pub(super) axes: Option<Axes>,
    /// The mounting that was taken out, roll pitch yaw \[deg\].
    pub(super) mounting_deg: Option<[f64; 3]>,
    /// The same as a rotation, from body to the reference's body.
    pub(super) mounting: UnitQuaternion<f64>,
    /// Median and 95 % of the angle between the attitudes, and of the turn about the vertical \[deg\].
    pub(super) rotation_spread: Option<Spread>,
    pub(super) heading_spread: Option<Spread>,
    /// RMS of the angle between the attitudes \[deg\].
    pub(super) rotation: Option<f64>,
    /// RMS of the turn about the vertical, and of what is left \[deg\].
    pub(super) heading: Option<f64>,
    pub(super) inclination: Option<f64>,
}

fusion_core::memory!(Attitudes { count, sums, turns, kept; removes_mounting });
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

    /// Epochs so far.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn add(&mut self, time: Time, a: &AttitudeError) {
        self.count += 1;
        let degrees = in_degrees(&a.rpy);
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

    pub(super) fn finish(self) -> Found {
        let kept = self.kept.rows();
        if !self.removes_mounting {
            return Found::of(self.sums, self.turns, self.count as f64, None);
        }
        let mounting = mean_rotation(kept.iter().map(|k| k.estimate.inverse() * k.truth));
        let mounting_deg: [f64; 3] = so3::to_rpy(&mounting).map(f64::to_degrees).into();
        let shown = rotation_of(mounting_deg);
        let (mut sums, mut turns) = (Sums::default(), Turns::default());
        for k in kept {
            let error = attitude_error(&(k.estimate * mounting), &k.truth).map(f64::to_degrees);
            sums.add_error(k.time, &error, &k.sigma, [true; 3], k.is_estimated);
            turns.add(&(k.estimate * shown * k.truth.inverse()));
        }
        Found::of(sums, turns, kept.len() as f64, Some(mounting_deg))
    }
}

impl Found {
    fn of(sums: Sums, mut turns: Turns, count: f64, mounting_deg: Option<[f64; 3]>) -> Self {
        let degrees = |of: &mut Quantiles| Spread::of(of).map(|spread| spread.times(1_f64.to_degrees()));
        let rms = |squares: f64| (count > 0.0).then(|| (squares / count).sqrt().to_degrees());
        Self {
            axes: sums.axes(),
            mounting_deg,
            mounting: mounting_deg.map(rotation_of).unwrap_or_default(),
            rotation_spread: degrees(&mut turns.angles),
            heading_spread: degrees(&mut turns.headings),
            rotation: rms(turns.whole),
            heading: rms(turns.heading),
            inclination: rms(turns.inclination),
        }
    }
}

/// The rotation of roll, pitch, yaw \[deg\].
fn rotation_of(rpy_deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [roll, pitch, yaw] = rpy_deg.map(f64::to_radians);
    so3::from_rpy(roll, pitch, yaw)
}

/// The least turn about the vertical of the rotation `e` between two attitudes, resolved in
/// navigation axes, and the turn about a level axis that is left \[rad\].
pub(super) fn swing_and_twist(e: &UnitQuaternion<f64>) -> [f64; 2] {
    // atan2 for acos √(w² + z²), which is coarse near 0.
    [2.0 * e.k.abs().atan2(e.w.abs()), 2.0 * e.i.hypot(e.j).atan2(e.w.hypot(e.k))]
}

/// The rotation with the least mean squared angle to all of `rotations`.
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

/// Of an error in radians.
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
