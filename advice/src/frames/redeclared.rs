//! Attitudes in another form than declared: a quaternion in another order, or with the inverse rotation.
//!
//! An inertial unit that is otherwise right agrees with the attitude in its forces and its rates. If only the axes of
//! the unit are wrong, both match the expected values on other signed axes. For a quaternion in another order they do
//! not: force and rate then require axes that contradict each other. The most common mistakes are then tried on the
//! data, so the advice has been tested.

use super::clock;
use super::field::permutations;
use super::judge::{Comparison, Expected, Judge, known, turns_little};
use super::log::{self, Track};
use super::mistake::{Remedy, at};
use super::motion::{Attitudes, Velocities};
use super::regression::{FAR, Fit, NEAR};
use super::world::{is_contradicted, vote};
use fusion::config::{Edit, Node, Value};
use fusion::design::Design;
use fusion_core::math;

/// A key of a channel and its value.
type Assignment = (&'static str, String);

/// The agreement of an attitude with force and rate of an inertial unit.
struct Agreement {
    force: [Option<Fit>; 3],
    rate: [Option<Fit>; 3],
}

impl Agreement {
    fn is_contradicted(&self) -> bool {
        is_contradicted(&self.force, FAR) || is_contradicted(&self.rate, NEAR)
    }

    /// Returns true if both contradict the attitude, and no axes of the unit satisfy both.
    fn is_in_conflict(&self) -> bool {
        let [force, rate] = [known(&self.force), known(&self.rate)];
        let fits =
            |known: &[Option<(usize, bool)>; 3], axes: &[(usize, bool); 3]| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row]));
        let is_told = |known: &[Option<(usize, bool)>; 3]| (0..3).any(|row| known[row].is_some_and(|k| k != (row, false)));
        // Force and rate may each have wrong axes, but then all three axes are determined.
        let is_whole = |known: &[Option<(usize, bool)>; 3]| permutations().iter().any(|axes| *known == axes.map(Some));
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
        let of = |fits: &[Option<Fit>; 3]| {
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
    /// An attitude as it should have been declared; `None` if it is wrong and no declaration corrects it.
    pub(super) fn redeclared(&mut self, track: Track, velocities: Option<&Velocities>) -> Option<Track> {
        let before = self.agreements(&track, velocities);
        // If nothing agrees, the motion may be too small or the attitude wrong. Another declaration that agrees
        // decides.
        if before.is_empty() || !before.iter().any(Agreement::is_contradicted) && before.iter().all(Agreement::is_enough) {
            return Some(track);
        }
        let node = self.node(&track);
        let explained = |all: &[Agreement], by_any: bool| all.iter().map(|a| a.explained(by_any)).fold(f64::INFINITY, f64::min);
        // If no axes of the unit explain the data, the axes of the unit are not the mistake.
        let is_in_conflict = before.iter().any(Agreement::is_in_conflict);
        let needed = explained(&before, !is_in_conflict) + BETTER;
        let right = declarations(node.at("channels.attitude")).into_iter().find_map(|written| {
            let other = self.read_as(&track, &written)?;
            let after = self.agreements(&other, velocities);
            let is_right = after.iter().all(Agreement::is_right) && explained(&after, false) > needed;
            is_right.then_some((written, other))
        });
        if right.is_none() && !is_in_conflict {
            return Some(track);
        }
        let name = self.name(&track);
        let help = match &right {
            Some((written, _)) => Remedy {
                words: format!("they agree with it as `{}`: write that", listed(written)),
                ..Remedy::write(written)
            },
            None => Remedy::words(
                "check the order of its numbers, whether it is the inverse, and its axes: `inverse`, `navigation_rotation`, `rotation`",
            ),
        };
        let message = format!("`{name}` contradicts the inertial unit, and no axes of the unit explain it");
        let told = help.of(at("attitude-form", node, "attitude", "quaternion", message), &self.table(&track));
        self.found.mistakes.push(told);
        self.found.comparisons.push(Comparison {
            what: name,
            with: "forces and rates of the inertial unit".to_owned(),
            samples: track.times.len(),
            correlation: Vec::new(),
            margin: 0.0,
            verdict: match &right {
                Some((written, _)) => format!("written as `{}`", listed(written)),
                None => "contradicted, and no axes of the unit explain it".to_owned(),
            },
        });
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
                    force: Expected::of(&force, &slow, lag).fits(),
                    rate: Expected::of(&rates, &turns, lag).fits(),
                }
            })
            .collect()
    }

    /// Reads a channel with another declaration.
    pub(super) fn read_as(&self, track: &Track, written: &[Assignment]) -> Option<Track> {
        let mut document = self.design.document.clone();
        let table = self.table(track);
        let edits = written.iter().map(|(key, value)| Edit::set(*key, value).within(&table));
        edits.into_iter().try_for_each(|edit| document.apply(&edit)).ok()?;
        let design = Design::read(document).ok()?;
        let read = log::read_source(&design, self.options, track.source).ok()?;
        read.into_iter().find(|other| other.channel == track.channel)
    }
}

fn listed(written: &[Assignment]) -> String {
    let each: Vec<String> = written.iter().map(|(key, value)| format!("{key} = {value}")).collect();
    each.join(", ")
}

/// Other declarations of an attitude.
fn declarations(channel: Option<&Node>) -> Vec<Vec<Assignment>> {
    let inverse = channel.and_then(|c| c.get("inverse")).is_some_and(|n| n.inline() == "true");
    let inverse = ("inverse", (!inverse).to_string());
    let columns = channel.and_then(|c| c.get("quaternion")).and_then(|q| match q.value() {
        Value::Array(items) => items.iter().map(Node::as_str).collect::<Option<Vec<&str>>>(),
        _ => None,
    });
    let mut orders = Vec::new();
    if let Some([a, b, c, d]) = columns.as_deref() {
        // Scalar last instead of scalar first, and the reverse.
        orders.extend([[d, a, b, c], [b, c, d, a]].map(|order| ("quaternion", format!("{order:?}"))));
    }
    let alone = orders.iter().map(|order| vec![order.clone()]);
    let both = orders.iter().map(|order| vec![order.clone(), inverse.clone()]);
    let mut all: Vec<Vec<Assignment>> = alone.chain([vec![inverse.clone()]]).chain(both).collect();
    // Forward, left, up, in a world with the vertical axis up.
    if ["rotation", "navigation_rotation"]
        .iter()
        .all(|key| channel.is_none_or(|c| c.get(key).is_none()))
    {
        let up = ["rotation", "navigation_rotation"].map(|key| (key, "{ axes = [\"x\", \"-y\", \"-z\"] }".to_owned()));
        let turned = all.iter().map(|written| [&written[..], &up[..]].concat());
        let turned: Vec<Vec<Assignment>> = turned.chain([up.to_vec()]).collect();
        all.extend(turned);
    }
    // Angles in another unit.
    if channel.is_some_and(|c| c.get("rpy").is_some()) {
        let is_degrees = channel.and_then(|c| c.get("unit")).and_then(Node::as_str) == Some("deg");
        all.push(vec![("unit", format!("{:?}", if is_degrees { "rad" } else { "deg" }))]);
    }
    all
}
