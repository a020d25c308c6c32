//! Attitudes: which of them to compare the instruments with, and attitudes in another form than declared.
//!
//! An inertial unit that is otherwise right agrees with the attitude in its forces and its rates. If only the axes of
//! the unit are wrong, both match the expected values on other signed axes. For a quaternion in another order they do
//! not: force and rate then require axes that contradict each other. The most common mistakes are then tried on the
//! data, so the advice has been tested.

use super::clock;
use super::field::permutations;
use super::judge::Judge;
use super::log::Track;
use super::mistake::Remedy;
use super::motion::{Attitudes, Velocities};
use super::regression::{FAR, Fits, Known, NEAR, known, vote};
use super::unit::{Seen, turns_little};
use super::world::Moved;
use fusion_core::math;

/// The agreement of an attitude with force and rate of an inertial unit.
struct Agreement {
    force: Fits,
    rate: Fits,
}

impl Agreement {
    fn is_contradicted(&self) -> bool {
        vote(&self.force, FAR) < 0 || vote(&self.rate, NEAR) < 0
    }

    /// Returns true if both contradict the attitude, and no axes of the unit satisfy both.
    fn is_in_conflict(&self) -> bool {
        let [force, rate] = [known(&self.force), known(&self.rate)];
        let fits = |known: &Known, axes: &[(usize, bool); 3]| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row]));
        let is_told = |known: &Known| (0..3).any(|row| known[row].is_some_and(|k| k != (row, false)));
        // Force and rate may each have wrong axes, but then all three axes are determined.
        let is_whole = |known: &Known| permutations().iter().any(|axes| *known == axes.map(Some));
        let is_one = permutations().iter().any(|axes| fits(&force, axes) && fits(&rate, axes));
        is_told(&force) && is_told(&rate) && !is_one && !(is_whole(&force) && is_whole(&rate))
    }

    /// Returns true if all rates are decided, or if the fits explain forces and rates as well as for a correct
    /// attitude.
    fn is_enough(&self) -> bool {
        known(&self.rate).iter().all(Option::is_some) || self.explained(true) > MOST
    }

    /// Returns true if the unit agrees with the attitude as declared.
    fn is_right(&self) -> bool {
        // Two rates of a small motion, or one rate with the tilt from the forces.
        let [rate, force] = [&self.rate, &self.force].map(|fits| known(fits).iter().flatten().count());
        (rate >= 2 || rate == 1 && force >= 2) && vote(&self.rate, NEAR) > 0 && vote(&self.force, FAR) >= 0
    }

    /// How well the declared axes explain forces and rates; with `by_any`, how well any axes of the unit do.
    fn explained(&self, by_any: bool) -> f64 {
        let of = |fits: &Fits| {
            let rows = fits.iter().enumerate().filter_map(|(row, fit)| Some((row, fit.as_ref()?)));
            let counted = rows.filter(|(row, fit)| by_any || (fit.axis, fit.negative) == (*row, false));
            counted.map(|(_, fit)| math::powi(fit.correlation, 2)).sum::<f64>()
        };
        of(&self.force) + of(&self.rate)
    }
}

/// The gain that another declaration needs over any axes of the unit, out of three axes of forces and three of rates.
/// Some orders of a quaternion are equivalent to a rotation of the unit.
const BETTER: f64 = 0.5;
/// The least total, out of six, for a correct attitude with little motion: correlations of 0.87 and more.
const MOST: f64 = 4.5;

impl Judge<'_> {
    /// The attitude to compare the instruments with. It must not contradict the course.
    pub(super) fn attitude(&mut self, velocities: &[Moved]) -> Option<Seen> {
        let moved = velocities.first();
        let mut right = Vec::new();
        for track in self.all("attitude") {
            right.extend(self.redeclared(track, moved.map(|moved| &moved.velocities)));
        }
        right.retain(|track| moved.is_none_or(|moved| self.heading(track, moved)));
        for track in self.all("heading") {
            moved.map(|moved| self.heading(&track, moved));
        }
        right.sort_by_key(|track| self.is_reference(track));
        right.first().map(|track| Seen {
            source: track.source,
            name: self.name(track),
            attitudes: Attitudes::of(track),
        })
    }

    /// An attitude as it should have been declared; `None` if it is wrong and no declaration corrects it.
    fn redeclared(&mut self, track: Track, velocities: Option<&Velocities>) -> Option<Track> {
        let before = self.agreements(&track, velocities);
        // If nothing agrees, the motion may be too small or the attitude wrong. Another declaration that agrees
        // decides.
        if before.is_empty() || !before.iter().any(Agreement::is_contradicted) && before.iter().all(Agreement::is_enough) {
            return Some(track);
        }
        let explained = |all: &[Agreement], by_any: bool| all.iter().map(|a| a.explained(by_any)).fold(f64::INFINITY, f64::min);
        // If no axes of the unit explain the data, the axes of the unit are not the mistake.
        let is_in_conflict = before.iter().any(Agreement::is_in_conflict);
        let needed = explained(&before, !is_in_conflict) + BETTER;
        let right = self.declared_as(&track, |other| {
            let after = self.agreements(other, velocities);
            after.iter().all(Agreement::is_right) && explained(&after, false) > needed
        });
        if right.is_none() && !is_in_conflict {
            return Some(track);
        }
        let (help, verdict) = match &right {
            Some((written, _)) => {
                let words = format!("they agree with it as `{}`: write that", written.listed());
                let remedy = Remedy { words, ..written.remedy() };
                (remedy, format!("written as `{}`", written.listed()))
            }
            None => (
                Remedy::words(
                    "check the order of its numbers, whether it is the inverse, and its axes: `inverse`, `navigation_rotation`, `rotation`",
                ),
                "contradicted, and no axes of the unit explain it".to_owned(),
            ),
        };
        let message = format!(
            "`{}` contradicts the inertial unit, and no axes of the unit explain it",
            self.name(&track)
        );
        self.accuse(&track, "attitude-form", "quaternion", message, help);
        self.list(&track, "forces and rates of the inertial unit", track.times.len(), verdict);
        right.map(|(_, other)| other)
    }

    /// The agreement of an attitude with each inertial unit of the vehicle.
    fn agreements(&self, track: &Track, velocities: Option<&Velocities>) -> Vec<Agreement> {
        let attitudes = Attitudes::of(track);
        let (turns, forces) = (attitudes.turns().collect::<Vec<_>>(), attitudes.forces(velocities));
        let units = self.all("angular_rate").into_iter().filter(|rates| !self.is_reference(rates));
        let units = units.filter_map(|rates| Some((self.beside(&rates, "specific_force")?, rates)));
        units
            .map(|(force, rates)| {
                let lag = clock::widest(&rates, &turns);
                let slow: Vec<_> = forces.iter().filter(|told| turns_little(&rates, told, lag)).copied().collect();
                Agreement {
                    force: force.fits(&slow, lag),
                    rate: rates.fits(&turns, lag),
                }
            })
            .collect()
    }
}
