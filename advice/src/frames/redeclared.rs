//! Attitudes that are written in another way than declared: a quaternion in another order, or that turns the other way.
//!
//! An inertial unit that is right otherwise agrees with the attitude by its forces and by its rates. Wrong axes of the unit are signed
//! axes of what is expected. A quaternion in another order makes neither: then force and rate want axes that contradict each other. The
//! declarations that are mistaken most often are tried in its place, on the data; so the advice is what was tried.

use super::clock;
use super::field::permutations;
use super::judge::{Comparison, Expected, Judge, known, turns_little};
use super::log::{self, Track};
use super::mistake::at;
use super::motion::{Attitudes, Velocities};
use super::regression::{FAR, Fit, NEAR};
use super::world::{is_contradicted, vote};
use fusion::config::{Node, Value};
use fusion::design::Design;

/// What force and rate of an inertial unit say of an attitude.
struct Agreement {
    force: [Option<Fit>; 3],
    rate: [Option<Fit>; 3],
}

impl Agreement {
    fn is_contradicted(&self) -> bool {
        is_contradicted(&self.force, FAR) || is_contradicted(&self.rate, NEAR)
    }

    /// Whether both contradict the attitude, and no axes of the unit are those that both want.
    fn is_in_conflict(&self) -> bool {
        let [force, rate] = [known(&self.force), known(&self.rate)];
        let fits =
            |known: &[Option<(usize, bool)>; 3], axes: &[(usize, bool); 3]| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row]));
        let is_told = |known: &[Option<(usize, bool)>; 3]| (0..3).any(|row| known[row].is_some_and(|k| k != (row, false)));
        // Force and rate may have wrong axes each, but then these are whole.
        let is_whole = |known: &[Option<(usize, bool)>; 3]| permutations().iter().any(|axes| *known == axes.map(Some));
        let is_one = permutations().iter().any(|axes| fits(&force, axes) && fits(&rate, axes));
        is_told(&force) && is_told(&rate) && !is_one && !(is_whole(&force) && is_whole(&rate))
    }

    /// Whether all rates are decided, or forces and rates are explained as those of a unit that goes with its attitude are.
    fn is_enough(&self) -> bool {
        known(&self.rate).iter().all(Option::is_some) || self.explained(true) > MOST
    }

    /// Whether the unit goes with the attitude as declared.
    fn is_right(&self) -> bool {
        // Two rates of a small motion, or one with the tilt that forces tell.
        let [rate, force] = [&self.rate, &self.force].map(|fits| known(fits).iter().flatten().count());
        (rate >= 2 || rate == 1 && force >= 2) && vote(&self.rate, NEAR) > 0 && vote(&self.force, FAR) >= 0
    }

    /// How much of forces and turns the declared axes explain, or any axes of the unit.
    fn explained(&self, by_any: bool) -> f64 {
        let of = |fits: &[Option<Fit>; 3]| {
            let rows = fits.iter().enumerate().filter_map(|(row, fit)| Some((row, fit.as_ref()?)));
            let counted = rows.filter(|(row, fit)| by_any || (fit.axis, fit.negative) == (*row, false));
            counted.map(|(_, fit)| fit.correlation.powi(2)).sum::<f64>()
        };
        of(&self.force) + of(&self.rate)
    }
}

/// How much more of three axes of forces and three of turns another declaration has to explain than any axes of the unit do: some
/// orders of a quaternion are a turn of the unit.
const BETTER: f64 = 0.5;
/// What little motion leaves of the six that a right attitude explains: correlations of 0.87 and more.
const MOST: f64 = 4.5;

impl Judge<'_> {
    /// An attitude as it should have been declared; `None` where it is wrong and nothing puts it right.
    pub(super) fn redeclared(&mut self, track: Track, velocities: Option<&Velocities>) -> Option<Track> {
        let before = self.agreements(&track, velocities);
        // Where nothing agrees the motion may be too little, or the attitude wrong: another one that agrees decides.
        if before.is_empty() || !before.iter().any(Agreement::is_contradicted) && before.iter().all(Agreement::is_enough) {
            return Some(track);
        }
        let node = self.node(&track);
        let explained = |all: &[Agreement], by_any: bool| all.iter().map(|a| a.explained(by_any)).fold(f64::INFINITY, f64::min);
        // What no axes of the unit explain is no mistake of theirs.
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
            Some((written, _)) => format!("they agree with it as `{}`: write that", written.join(", ")),
            None => "check the order of its numbers, whether it is the inverse, and its axes: `inverse`, `navigation_rotation`, `rotation`"
                .to_owned(),
        };
        let message = format!("`{name}` contradicts the inertial unit, and no axes of the unit explain it");
        let told = at(node, "attitude", "quaternion", message).help(help);
        self.found.mistakes.push(told);
        self.found.comparisons.push(Comparison {
            what: name,
            with: "forces and rates of the inertial unit".to_owned(),
            samples: track.times.len(),
            correlation: Vec::new(),
            margin: 0.0,
            verdict: match &right {
                Some((written, _)) => format!("written as `{}`", written.join(", ")),
                None => "contradicted, and no axes of the unit explain it".to_owned(),
            },
        });
        right.map(|(_, other)| other)
    }

    /// What every inertial unit of the vehicle says of an attitude.
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

    /// Reads a channel as if it were declared so.
    pub(super) fn read_as(&self, track: &Track, written: &[String]) -> Option<Track> {
        let mut document = self.design.document.clone();
        let path = format!("source.{}.channels.{}", self.design.sources[track.source].name, track.channel);
        written.iter().try_for_each(|one| document.set(&format!("{path}.{one}"))).ok()?;
        let design = Design::read(document).ok()?;
        let read = log::read_source(&design, self.options, track.source).ok()?;
        read.into_iter().find(|other| other.channel == track.channel)
    }
}

/// Other ways to declare an attitude, as what is to be written.
fn declarations(channel: Option<&Node>) -> Vec<Vec<String>> {
    let inverse = channel.and_then(|c| c.get("inverse")).is_some_and(|n| n.inline() == "true");
    let inverse = format!("inverse = {}", !inverse);
    let columns = channel.and_then(|c| c.get("quaternion")).and_then(|q| match q.value() {
        Value::Array(items) => items.iter().map(Node::as_str).collect::<Option<Vec<&str>>>(),
        _ => None,
    });
    let mut orders = Vec::new();
    if let Some([a, b, c, d]) = columns.as_deref() {
        // The scalar last for the scalar first, and the other way round.
        orders.extend([[d, a, b, c], [b, c, d, a]].map(|order| format!("quaternion = {order:?}")));
    }
    let alone = orders.iter().map(|order| vec![order.clone()]);
    let both = orders.iter().map(|order| vec![order.clone(), inverse.clone()]);
    let mut all: Vec<Vec<String>> = alone.chain([vec![inverse.clone()]]).chain(both).collect();
    // Forward, left, up in a world whose vertical is up.
    if ["rotation", "navigation_rotation"]
        .iter()
        .all(|key| channel.is_none_or(|c| c.get(key).is_none()))
    {
        let up = ["rotation", "navigation_rotation"].map(|key| format!("{key} = {{ axes = [\"x\", \"-y\", \"-z\"] }}"));
        let turned = all.iter().map(|written| [&written[..], &up[..]].concat());
        let turned: Vec<Vec<String>> = turned.chain([up.to_vec()]).collect();
        all.extend(turned);
    }
    // Angles in another unit.
    if channel.is_some_and(|c| c.get("rpy").is_some()) {
        let is_degrees = channel.and_then(|c| c.get("unit")).and_then(Node::as_str) == Some("deg");
        all.push(vec![format!("unit = {:?}", if is_degrees { "rad" } else { "deg" })]);
    }
    all
}
