//! Clocks that do not agree: finds the shift of the stamps at which two channels report the same motion.

use super::log::{Told, Track};
use super::regression::{Fit, PLAIN, Pairs, fit};
use fusion_core::math;
use nalgebra::Vector3;

/// Typical delays of a velocity or an attitude against the instruments \[s\]. Receivers are late by up to half a
/// second. Values that were smoothed in both directions are early.
const LAGS: [f64; 9] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, -0.1, -0.2];
/// Shifts to search for axes if a shift explains the data as well as wrong axes do.
const SOUGHT: [f64; 13] = [0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3, 0.4, -0.4, 0.5, -0.5, 0.6, -0.6];
/// The range of shifts to search \[s\], and the step sizes.
const WIDEST: f64 = 5.0;
/// ... if nothing agrees within that range. It includes the leap seconds between GPS time and UTC, 18 s since 2017.
const FARTHEST: f64 = 20.0;
const COARSE: f64 = 0.25;
const FINE: f64 = 0.05;
/// A shift is reported if it differs by more than this from every usual or declared shift \[s\].
const UNUSUAL: f64 = 0.3;
/// A slipping vehicle points in its direction of travel later, by up to this time \[s\]. The course cannot show a
/// shorter shift.
const SLIP: f64 = 1.5;
/// An antenna ahead of the turning point of a vehicle moves sideways earlier, by its arm divided by the speed \[s\].
const LEAD: f64 = 1.0;
/// The result of the comparison of two clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Clocks {
    /// The data are not sufficient.
    Untold,
    /// The stamps agree as well as usual.
    Together,
    /// The expected values are stamped later than the measured ones, by this time \[s\].
    Apart(f64),
}

/// The usual lag with the best correlation over all axes together, for any assignment of axes. `shift` is the shift of
/// the clocks.
pub(super) fn usual(measured: &Track, told: &[Told], shift: f64) -> f64 {
    best(measured, told, LAGS.into_iter().map(|lag| lag + shift))
}

/// As `usual`, with early lags as well as late ones.
pub(super) fn sought(measured: &Track, told: &[Told], shift: f64) -> f64 {
    best(measured, told, SOUGHT.into_iter().map(|lag| lag + shift))
}

/// The lag with the best correlation over all axes together, within the whole search range, for any assignment of axes.
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
    (0..=math::round((to - from) / step) as u32).map(move |k| from + step * f64::from(k))
}

fn best(measured: &Track, told: &[Told], lags: impl Iterator<Item = f64>) -> f64 {
    let size = |lag: f64| {
        let fits = measured.fits(told, lag);
        fits.iter().flatten().map(|f| math::powi(f.correlation, 2)).sum::<f64>()
    };
    // If several lags are equally good, this takes the first.
    let sizes = lags.map(|lag| (lag, size(lag)));
    sizes.fold((0.0, 0.0), |best, next| if next.1 > best.1 { next } else { best }).0
}

/// Compares the clocks. `declared` are the delays that the design declares; `is_course` is true if the comparison uses
/// a course.
pub(super) fn compare(measured: &Track, told: &[Told], declared: &[f64], is_course: bool) -> Clocks {
    let clearest = |lag: f64| {
        let fits = measured.fits(told, lag);
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
        // Waves repeat themselves; their correlation with a shifted log is lower.
        Some((row, fit)) if !is_usual(far) && fit.correlation >= PLAIN && is_better(measured, told, row, fit.axis, [near, far]) => {
            Clocks::Apart(far)
        }
        _ if clearest(near).is_some() => Clocks::Together,
        _ => Clocks::Untold,
    }
}

/// Returns true if the second lag is clearly better. The test treats both lags as two axes to choose from.
fn is_better(measured: &Track, told: &[Told], row: usize, axis: usize, lags: [f64; 2]) -> bool {
    let both = told.iter().filter_map(|(from, to, expected)| {
        let at = |lag: f64| Some(measured.mean(from - lag, to - lag)?[axis]);
        Some((Vector3::repeat(expected[row]), Vector3::new(at(lags[0])?, at(lags[1])?, 0.0)))
    });
    fit(0, &both.collect::<Pairs>()).is_some_and(|f| f.axis == 1 && f.is_better())
}
