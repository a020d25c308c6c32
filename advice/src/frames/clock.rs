//! Clocks that do not go together: at which shift of the stamps two channels tell of the same motion.

use super::judge::Expected;
use super::log::Track;
use super::motion::Told;
use super::regression::{CERTAIN, Fit, fit};
use nalgebra::Vector3;

/// How late a velocity or an attitude may be stamped against the instruments \[s\]: receivers are late by up to half a
/// second, and what is smoothed in both directions is early.
const LAGS: [f64; 9] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, -0.1, -0.2];
/// Shifts within which those axes are sought that a shift explains as well as wrong axes do.
const SOUGHT: [f64; 13] = [0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3, 0.4, -0.4, 0.5, -0.5, 0.6, -0.6];
/// Shifts that are searched \[s\], and how closely.
const WIDEST: f64 = 5.0;
/// ... where nothing agrees within them: the leap seconds between GPS time and UTC, 18 s since 2017, are within these.
const FARTHEST: f64 = 20.0;
const COARSE: f64 = 0.25;
const FINE: f64 = 0.05;
/// A shift that is further from all that is usual or declared is told \[s\].
const UNUSUAL: f64 = 0.3;
/// A vehicle that slips points where it goes that much later \[s\]: its course tells no shift below that.
const SLIP: f64 = 1.5;
/// An antenna ahead of the point that a vehicle turns about moves aside that much earlier: its arm over the speed \[s\].
const LEAD: f64 = 1.0;
/// The correlation from which on a shift is told: waves, which repeat themselves, agree with a shifted log by less.
const PLAIN: f64 = 0.9;

/// What two channels say of their clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Clocks {
    /// Too little.
    Untold,
    /// The stamps go together, as well as is usual.
    Together,
    /// What is expected is stamped so much later than what is measured \[s\].
    Apart(f64),
}

/// The usual lag at which all axes together correlate best, whichever they are; `shift` is that of the clocks.
pub(super) fn usual(measured: &Track, told: &[Told], shift: f64) -> f64 {
    best(measured, told, LAGS.into_iter().map(|lag| lag + shift))
}

/// The same, among early and late ones alike.
pub(super) fn sought(measured: &Track, told: &[Told], shift: f64) -> f64 {
    best(measured, told, SOUGHT.into_iter().map(|lag| lag + shift))
}

/// The lag within all that is searched at which all axes together correlate best, whichever they are.
pub(super) fn widest(measured: &Track, told: &[Told]) -> f64 {
    within(measured, told, WIDEST)
}

fn within(measured: &Track, told: &[Told], widest: f64) -> f64 {
    let coarse = best(measured, told, steps(-widest, widest, COARSE));
    best(
        measured,
        told,
        [0.0].into_iter().chain(steps(coarse - COARSE, coarse + COARSE, FINE)),
    )
}

fn steps(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    (0..=((to - from) / step).round() as u32).map(move |k| from + step * f64::from(k))
}

fn best(measured: &Track, told: &[Told], lags: impl Iterator<Item = f64>) -> f64 {
    let size = |lag: f64| {
        let fits = Expected::of(measured, told, lag).fits();
        fits.iter().flatten().map(|f| f.correlation.powi(2)).sum::<f64>()
    };
    // The first of several that are as good.
    let sizes = lags.map(|lag| (lag, size(lag)));
    sizes.fold((0.0, 0.0), |best, next| if next.1 > best.1 { next } else { best }).0
}

/// Compares the clocks; `declared` are the delays that the design knows of, and `is_course` says that a course is what tells.
pub(super) fn compare(measured: &Track, told: &[Told], declared: &[f64], is_course: bool) -> Clocks {
    let clearest = |lag: f64| {
        let fits = Expected::of(measured, told, lag).fits();
        let clear = fits
            .into_iter()
            .enumerate()
            .filter_map(|(row, f)| Some((row, f.filter(Fit::is_clear)?)));
        clear.max_by(|a, b| a.1.correlation.total_cmp(&b.1.correlation))
    };
    let near = usual(measured, told, 0.0);
    let mut far = widest(measured, told);
    if clearest(near).is_none() && clearest(far).is_none() {
        far = within(measured, told, FARTHEST);
    }
    let is_usual = |lag: f64| {
        let delays = declared.iter().flat_map(|d| LAGS.map(|lag| lag + d));
        is_course && (-LEAD..SLIP).contains(&lag) || LAGS.into_iter().chain(delays).any(|usual| (lag - usual).abs() < UNUSUAL)
    };
    match clearest(far) {
        Some((row, fit)) if !is_usual(far) && fit.correlation >= PLAIN && is_better(measured, told, row, fit.axis, [near, far]) => {
            Clocks::Apart(far)
        }
        _ if clearest(near).is_some() => Clocks::Together,
        _ => Clocks::Untold,
    }
}

/// Whether the second lag is better for certain: as if both were axes that one is to be chosen of.
fn is_better(measured: &Track, told: &[Told], row: usize, axis: usize, lags: [f64; 2]) -> bool {
    let both = told.iter().filter(|t| t.2[row].is_finite()).filter_map(|(from, to, expected)| {
        let at = |lag: f64| Some(measured.mean(from - lag, to - lag)?[axis]);
        Some((expected[row], Vector3::new(at(lags[0])?, at(lags[1])?, 0.0)))
    });
    let (expected, measured): (Vec<f64>, Vec<Vector3<f64>>) = both.unzip();
    fit(0, &expected, &measured).is_some_and(|f| f.axis == 1 && f.margin >= CERTAIN)
}
