//! The unit of a quantity, by the size of its values where no name gives it.

use super::numbers::{Vec3, moments, norm, quantile};
use super::signal::{Kind, Signal, UNNAMED, factor};
use super::turn;
use super::words::Words;
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use core::ops::Range;
use fusion::source::table::LogTable;
use fusion_core::math;

/// Standard gravity \[m/s²\].
pub(super) const GRAVITY: f64 = 9.80665;
/// Possible strengths of the Earth's field, including iron that a state can estimate \[T\].
pub(super) const STRENGTHS: core::ops::Range<f64> = 15e-6..80e-6;

/// Accelerations without gravity, or differences of a velocity: not the measurement of accelerometers.
pub(super) fn is_without_gravity(table: &LogTable, signal: &Signal) -> bool {
    let is_whole = signal
        .columns
        .iter()
        .all(|(k, _)| table.columns[*k].values.iter().take(1000).all(|v| math::fract(*v) == 0.0));
    signal.kind == Kind::SpecificForce && signal.unit == "counts" && !is_whole
}

/// Finds the unit and factor of a signal, from its name or its values.
pub(super) fn settle(signal: &mut Signal, table: &LogTable, rate: f64) {
    if let Some((unit, why)) = unit_by_values(signal, table, rate) {
        signal.why = format!("{}; {unit}: {why}", signal.why);
        signal.unit = unit.to_owned();
    }
    signal.factor = match (signal.kind, signal.unit.as_str()) {
        (Kind::SpecificForce, "counts") => GRAVITY / length(signal, table, 0.5),
        (_, unit) => factor(unit),
    };
}

/// Finds the unit of gyros without a named unit, from the turns of the magnetic field or of gravity. Hands turn a unit
/// faster than 10 rad/s, and vehicles turn slower than 10 deg/s, so the size alone does not show it.
pub(super) fn settle_by_turns(found: &mut [Signal], table: &LogTable, rate: f64) {
    /// In the first time, hands turn a unit by only a small angle. Over the others, the vibration of slower vehicles
    /// averages out [s].
    const STEPS: [f64; 3] = [0.1, 0.3, 1.0];
    // Accelerations do not turn the field.
    let directions = [(Kind::MagneticField, "the field"), (Kind::SpecificForce, "gravity")].map(|(kind, name)| {
        let signal = found.iter().find(|s| s.kind == kind && !s.increment);
        signal.map(|s| (s.values(table), name))
    });
    let gyros = found.iter_mut().find(|s| s.kind == Kind::AngularRate && !s.increment);
    let is_named = |s: &Signal| Words::of(table.columns[s.columns[0].0].called()).unit.is_some();
    let Some(gyros) = gyros.filter(|s| !is_named(s)) else { return };
    let raw: Vec<Vec3> = (0..table.rows()).map(|row| gyros.raw(table, row)).collect();
    let told = STEPS
        .iter()
        .flat_map(|step| directions.iter().flatten().map(move |told| (told, *step)));
    let mut slopes = told.filter_map(|((direction, name), step)| Some((turn::slope(direction, &raw, rate, step)?, *name)));
    let Some((slope, what)) = slopes.next() else { return };
    let (radians, degrees) = (1.0, 1_f64.to_radians());
    // The threshold is half-way between the two on a logarithmic scale.
    let unit = if slope > math::sqrt(radians * degrees) { "rad/s" } else { "deg/s" };
    if math::ln(slope / factor(unit)).abs() < math::ln(2_f64) {
        gyros.unit = unit.to_owned();
        gyros.factor = factor(unit);
        let found = gyros.why.split(';').next().unwrap_or_default().to_owned();
        gyros.why = format!("{found}; {unit}: {what} turns by {:.2} of what they say", slope / gyros.factor);
    }
}

/// No vehicle here is faster than sound \[m/s\].
const FASTEST: f64 = 340.0;

/// The median speed by positions with angles in rad, corrected for the rows that do not change \[m/s\].
fn usual_speed(s: &Signal, table: &LogTable, rate: f64) -> f64 {
    const RADIUS: f64 = 6.371e6;
    let place = |row: usize| s.raw(table, row);
    let is_fix = |p: &Vec3| p[..2] != [0.0, 0.0];
    let steps = (1..table.rows()).filter_map(|row| {
        let (a, b) = (place(row - 1), place(row));
        let step = math::hypot(b[0] - a[0], (b[1] - a[1]) * math::cos(a[0]));
        (step > 0.0 && is_fix(&a) && is_fix(&b)).then_some(step)
    });
    // A fix that is repeated in several rows moves once in several intervals. The share of rows that change corrects
    // for it.
    let changes = (1..table.rows()).filter(|row| place(*row)[..2] != place(*row - 1)[..2]).count() as f64;
    RADIUS * quantile(steps, 0.5) * rate * changes / table.rows().max(1) as f64
}

/// Returns true if angles are degrees and minutes in one number, as NMEA writes them: larger than any degrees, with
/// minutes below 60.
fn is_ddmm(s: &Signal, table: &LogTable) -> bool {
    let angles = || {
        (0..table.rows())
            .map(|row| s.raw(table, row))
            .filter(|v| v[0].is_finite() && v[1].is_finite())
    };
    matches!(s.unit.as_str(), "" | "deg")
        && is_beyond(s, table)
        && angles().all(|v| v[0].abs() <= 9000.0 && v[1].abs() <= 18_000.0 && v[..2].iter().all(|x| x.abs() % 100.0 < 60.0))
}

/// Returns true if angles in degrees would be beyond 90 or 360 in more than a hundredth of the rows.
pub(super) fn is_beyond(s: &Signal, table: &LogTable) -> bool {
    let reach = |axis: usize| quantile((0..table.rows()).map(|row| s.raw(table, row)[axis].abs()), 0.99);
    reach(0) > 90.0 || reach(1) > 360.0
}

/// The length of a vector that this share of the rows stays below, in the unit of its columns.
fn length(signal: &Signal, table: &LogTable, share: f64) -> f64 {
    quantile((0..table.rows()).map(|row| norm(signal.raw(table, row))), share)
}

/// The median length of the means over a second. Vibration and manoeuvres average out, and gravity does not. `None` for
/// a unit that tumbles, and for accelerations without gravity: the mean of the whole log is then small.
fn steady_length(signal: &Signal, table: &LogTable, rate: f64) -> Option<f64> {
    /// The least length of the mean of the whole log, as a share of the median length of the means.
    const UPRIGHT: f64 = 0.5;
    let second = math::round(rate).max(1.0) as usize;
    let mean = |rows: Range<usize>| [0, 1, 2].map(|axis| moments(rows.clone().map(|row| signal.raw(table, row)[axis])).0);
    let whole = table.rows() / second;
    let steady = quantile((0..whole).map(|k| norm(mean(k * second..(k + 1) * second))), 0.5);
    (norm(mean(0..table.rows())) > UPRIGHT * steady).then_some(steady)
}

/// The possible lengths of a vector in SI, and the units that instruments write it in, with the decimals that show it.
type Sizes = (Range<f64>, &'static [(&'static str, usize)]);

/// The sizes of a kind that the Earth determines.
fn sizes(kind: Kind) -> Option<Sizes> {
    match kind {
        // Gravity, and a tenth for motion and scale errors.
        Kind::SpecificForce => Some((0.9 * GRAVITY..1.1 * GRAVITY, &[("m/s^2", 2), ("g", 3), ("mg", 0)])),
        Kind::MagneticField => Some((STRENGTHS, &[("uT", 1), ("T", 7), ("nT", 0), ("gauss", 3), ("mgauss", 0)])),
        // No place with people has less than a third of the sea-level pressure.
        Kind::Pressure => Some((3e4..1.2e5, &[("Pa", 0), ("hPa", 1), ("kPa", 2)])),
        _ => None,
    }
}

/// The unit that the values suggest, and the reason; `None` if the name gives it.
fn unit_by_values(s: &Signal, table: &LogTable, rate: f64) -> Option<(&'static str, String)> {
    let reach = |axis: usize| quantile((0..table.rows()).map(|row| s.raw(table, row)[axis].abs()), 0.99);
    if s.kind == Kind::SpecificForce && s.increment {
        let m = length(s, table, 0.5) * rate;
        return Some(("m/s", format!("increments, median length × {rate:.0} Hz = {m:.2}")));
    }
    if s.kind == Kind::Geodetic && is_ddmm(s, table) {
        return Some(("ddmm", format!("latitudes reach {:.3}, minutes are below 60", reach(0))));
    }
    if !matches!(s.unit.as_str(), "" | "counts") {
        return None;
    }
    if let Some((sizes, units)) = sizes(s.kind) {
        let m = length(s, table, 0.5);
        let what = if s.kind == Kind::Pressure { "median" } else { "median length" };
        let steady = (s.kind == Kind::SpecificForce).then(|| steady_length(s, table, rate)).flatten();
        let steady = steady.map(|m| (m, "median length of the means over a second"));
        let is = [Some((m, what)), steady].into_iter().flatten().find_map(|(m, what)| {
            let (unit, decimals) = units.iter().find(|(unit, _)| sizes.contains(&(m * factor(unit))))?;
            Some((*unit, format!("{what} {m:.decimals$}")))
        });
        return match is {
            Some(found) => Some(found),
            None => (s.kind == Kind::SpecificForce).then(|| ("counts", format!("median length {m:.1}, taken as one g"))),
        };
    }
    let angles = |axis: usize| match reach(axis) {
        reach if reach > TAU => ("deg", format!("headings reach {reach:.1}")),
        reach => ("rad", format!("headings reach {reach:.2}")),
    };
    let rates = |reach: f64| {
        if reach > 10.0 {
            ("deg/s", format!("99 % are within {reach:.1}: more than 10 rad/s is rare"))
        } else {
            ("rad/s", format!("99 % are within {reach:.2}"))
        }
    };
    Some(match s.kind {
        Kind::AngularRate if s.unit == "counts" => return None,
        Kind::AngularRate => rates(length(s, table, 0.99)),
        Kind::YawRate => rates(reach(0)),
        Kind::Geodetic if reach(0) > FRAC_PI_2 => ("deg", format!("latitudes reach {:.3}", reach(0))),
        Kind::Geodetic if reach(1) > PI => ("deg", format!("longitudes reach {:.3}", reach(1))),
        Kind::Geodetic if usual_speed(s, table, rate) > FASTEST => ("deg", "in rad it would be faster than sound".to_owned()),
        Kind::Geodetic => ("rad", format!("longitudes reach {:.4}", reach(1))),
        Kind::Euler => angles(2),
        Kind::Heading => angles(0),
        Kind::Local | Kind::Depth | Kind::PositionSigma => ("m", UNNAMED.to_owned()),
        Kind::Velocity | Kind::BodyVelocity | Kind::Speed | Kind::GroundSpeed | Kind::VelocitySigma => ("m/s", UNNAMED.to_owned()),
        _ => return None,
    })
}
