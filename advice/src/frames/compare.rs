//! The verdict on the axes and the unit of a channel, from the fits of a comparison.

use super::judge::{Comparison, Judge};
use super::log::Track;
use super::mistake::{self, Axes, Remedy, Whole, complete, differing, names, remedy, unit};
use super::regression::{Fits, Known, known, wrong_factor};
use fusion_tables::short;

/// The other side of a comparison, and its settings.
#[derive(Default)]
pub(super) struct Compared<'a> {
    pub(super) with: &'a str,
    pub(super) is_world: bool,
    /// The least factor at which the numbers are wrong.
    pub(super) limit: f64,
    /// The text if nothing could be compared.
    pub(super) lack: &'a str,
    /// The delay of the stamps \[s\].
    pub(super) shift: f64,
    /// The axes that give the signs if the data do not decide them.
    pub(super) axes: Option<Axes>,
    /// The advice if the other side of the comparison is wrong.
    pub(super) or: Option<&'a str>,
}

/// A factor in words.
pub(super) fn sized(small: f64) -> String {
    let (by, size) = if small > 1.0 { (small, "small") } else { (1.0 / small, "large") };
    format!("too {size} by a factor of {}", short(by))
}

impl Judge<'_> {
    /// Reports the result of the fits of a channel, or what they lack. Returns the axes and the factor that correct it.
    pub(super) fn compare(&mut self, track: &Track, fits: &Fits, compared: &Compared<'_>) -> (Axes, f64) {
        if fits.iter().all(Option::is_none) {
            self.list(track, compared.with, 0, compared.lack);
            return (mistake::DECLARED, 1.0);
        }
        let (known, factor) = (known(fits), wrong_factor(fits, compared.limit));
        let wrong = differing(&known, compared.is_world);
        let verdict = verdict(track, &known, factor, compared);
        let listed = Comparison::along(self.name(track), compared.with, fits, verdict);
        self.found.comparisons.push(listed);
        // The data come first, even if they are few. If they agree with the rotation of the housing, this rotation
        // decides the rest.
        let housing = compared
            .axes
            .filter(|axes| (0..3).all(|row| known[row].is_none_or(|k| k == axes[row])));
        let sign = |row: usize, axis: usize| {
            let leans = fits[row].and_then(|f| f.leans(axis));
            leans.or_else(|| housing.map(|axes| axes[row]).filter(|a| a.0 == axis).map(|a| a.1))
        };
        // A different mounting turns a unit but does not mirror it.
        let whole = complete(known, sign).map(|whole| if compared.is_world { whole } else { whole.turned() });
        if !wrong.is_empty() {
            self.axes(track, &known, whole, compared);
        }
        if let Some((small, within)) = factor {
            self.factor(track, compared.with, small, within);
        }
        (whole.map_or(mistake::DECLARED, |w| w.axes), factor.map_or(1.0, |f| f.0))
    }

    /// The axes of a channel differ from the declared ones.
    pub(super) fn axes(&mut self, track: &Track, known: &Known, whole: Option<Whole>, compared: &Compared<'_>) {
        let channel = self.channel(track);
        let &Compared { with, is_world, or, .. } = compared;
        let what = if is_world { "north, east, down" } else { "forward, right, down" };
        let message = format!(
            "the axes of `{}` are not {what}: compared with {with}, {}",
            self.name(track),
            differing(known, is_world)
        );
        let help = match whole {
            Some(Whole { axes, open }) => {
                let open = open.map(|row| mistake::of_rows(is_world, |other| other == row));
                let open = open.map_or_else(String::new, |row| {
                    let is = if is_world {
                        "kept as declared"
                    } else {
                        "that which makes the axes right-handed"
                    };
                    format!("; the sign of {row} is not decided by these data: it is {is}")
                });
                remedy(channel, &axes).and(&open)
            }
            None => {
                let unknown: Vec<&str> = (0..3).filter(|i| known[*i].is_none()).map(|i| names(is_world)[i]).collect();
                match unknown[..] {
                    [] => Remedy::words("two axes seem to be the same: check the columns"),
                    _ if is_upside_down(track, known) => Remedy::words(format!(
                        "a unit that is upside down has its gyros turned too: {}, and the gyros likewise; or name the axes in which it is mounted",
                        remedy(channel, &UPSIDE_DOWN).words
                    )),
                    _ => Remedy::words(format!(
                        "change the columns or their signs; about {} these data say nothing",
                        unknown.join(" and ")
                    )),
                }
            }
        };
        let or = or.map_or_else(String::new, |or| format!("; or, {or}"));
        self.accuse(track, "axes", "columns", message, help.and(&or));
    }

    /// The numbers of a channel are too small or too large by a factor.
    pub(super) fn factor(&mut self, track: &Track, with: &str, small: f64, within: f64) {
        let message = format!("`{}` is {}, compared with {with}", self.name(track), sized(small));
        // A rate compared with a course includes slip and lag, so its tolerance is wide.
        let within = if track.channel == "velocity" { within.max(0.05) } else { 0.25 };
        let help = unit(self.channel(track), track.channel, small, within, track.rate);
        self.accuse(track, "unit", "unit", message, help.unwrap_or_else(mistake::check_unit));
    }
}

/// The verdict in words.
fn verdict(track: &Track, known: &Known, factor: Option<(f64, f64)>, compared: &Compared<'_>) -> String {
    let wrong = differing(known, compared.is_world);
    let is = match factor {
        _ if *known == [None; 3] && is_unsigned(track) => {
            "not decided: no agreement, and none of its numbers changes its sign: are they 1σ?".to_owned()
        }
        _ if *known == [None; 3] => "not decided: no agreement, or too little motion".to_owned(),
        Some((small, _)) if wrong.is_empty() => sized(small),
        None if wrong.is_empty() => "as declared".to_owned(),
        _ => wrong.clone(),
    };
    let rows = |is_known: bool| mistake::of_rows(compared.is_world, |row| known[row].is_some() == is_known);
    let (decided, open) = (rows(true), rows(false));
    let shift = match compared.shift {
        0.0 => String::new(),
        shift => format!(", {:.2} s apart", shift.abs()),
    };
    match (decided.is_empty() || open.is_empty(), wrong.is_empty()) {
        (true, _) => is + &shift,
        (false, true) => format!("{decided} {is}; {open} not decided{shift}"),
        (false, false) => format!("{is}; {open} not decided{shift}"),
    }
}

/// A rotation by 180° about the forward axis.
const UPSIDE_DOWN: Axes = [(0, false), (1, true), (2, true)];

/// Returns true if only gravity is known for the unit, and it points up.
fn is_upside_down(track: &Track, known: &Known) -> bool {
    track.channel == "specific_force" && *known == [None, None, Some((2, true))]
}

/// Returns true if a velocity moves, but never in both directions along any axis.
fn is_unsigned(track: &Track) -> bool {
    let one_way = |i: usize| track.values.iter().all(|v| v[i] >= 0.0) || track.values.iter().all(|v| v[i] <= 0.0);
    let moves = track.values.iter().any(|v| v[0] != 0.0 && v[1] != 0.0);
    track.channel == "velocity" && moves && (0..3).all(one_way)
}
