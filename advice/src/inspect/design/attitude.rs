//! An inertial unit alone: attitude by gyros and gravity.

use super::draft::Draft;
use crate::inspect::signal::Kind::{AngularRate, MagneticField, Quaternion, SpecificForce};
use crate::inspect::{Imu, Inspection, Rest};

impl Inspection {
    pub(super) fn attitude(&self, draft: &mut Draft) {
        let Some((k, imu)) = &self.imu else { return };
        let field = self.compass(*k, imu);
        let other = field.filter(|field| field.log != *k);
        draft.part("attitude only");
        self.gyro_bias(draft, "gyro_bias", imu.rest.as_ref(), "guessed: a micro-mechanical unit");
        self.apart(draft);
        self.levelling(draft, imu);
        if field.is_some() {
            draft.part("heading by compass");
            draft.set("source", "compass");
            draft.reason("sigma", "guessed: iron nearby");
        } else {
            draft.part("heading by definition");
        }
        draft.part("gravity");
        if let Some(rest) = &imu.rest {
            resting(draft, rest);
        }
        if let Some(field) = field {
            draft.part("compass");
            draft.set("source", if other.is_some() { "magnetometer" } else { "imu" });
            draft.part("field");
            draft.set("strength.initial", format!("{:.1} uT", 1e6 * field.strength));
            draft.reason("strength", field.why);
            draft.set("inclination.initial", format!("{:.1} deg", field.dip.to_degrees()));
        }
        draft.part("data");
        draft.note(&format!("guessed: {} is up", crate::inspect::page::axis(imu.up)));
        let own = field.filter(|field| field.log == *k).map(|_| MagneticField);
        let kinds: Vec<_> = [Some(AngularRate), Some(SpecificForce), own].into_iter().flatten().collect();
        self.source(draft, "imu", *k, &kinds, None);
        if let Some(compass) = other {
            self.source(draft, "magnetometer", compass.log, &[MagneticField], None);
        }
    }

    /// The magnetometer: in the unit's own file, or in another one whose field turns as the gyros do.
    fn compass(&self, unit: usize, imu: &Imu) -> Option<Compass> {
        let is_known = self.logs[unit].signal(MagneticField).is_some_and(|s| !s.unit.is_empty());
        let own = imu.field.filter(|_| is_known).map(|(strength, dip)| Compass {
            log: unit,
            strength,
            dip,
            why: "guessed: as during the first rest",
        });
        let other = || {
            let (log, field) = self.earth_field()?;
            Some(Compass {
                log,
                strength: field.strength,
                dip: field.dip,
                why: "guessed: its median",
            })
        };
        own.or_else(other)
    }

    /// The attitude that another system recorded.
    pub(super) fn judge_attitude(&self, draft: &mut Draft) {
        draft.part("judge");
        let Some(k) = self.with(Quaternion) else {
            return draft.part("no attitude to judge by");
        };
        draft.part("attitude to judge by");
        self.source(draft, "truth", k, &[Quaternion], None);
        draft.part("reference");
        draft.set("source", "truth");
    }
}

/// While it rests, gyros show their bias.
fn resting(draft: &mut Draft, rest: &Rest) {
    draft.part("rest");
    super::strapdown::still(draft, rest, rest.times, &super::strapdown::limits(rest));
    draft.part("resting gyros");
}

/// A magnetometer and the Earth's field that it reads.
#[derive(Clone, Copy)]
struct Compass {
    log: usize,
    /// \[T\]
    strength: f64,
    /// Below the horizon \[rad\].
    dip: f64,
    why: &'static str,
}
