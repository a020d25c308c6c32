//! The tables of sensors: positions and all other aiding.

use super::draft::{Draft, list, number};
use super::{WITHHELD, is_local, track_stride};
use crate::inspect::numbers::{by_half, median, resolution, scatter};
use crate::inspect::signal::Kind::{
    self, AttitudeSigma, BodyVelocity, Depth, Euler, Geodetic, Heading, Local, MagneticField, PositionSigma, Pressure, Quaternion, Speed,
    Velocity, VelocitySigma,
};
use crate::inspect::track::{Claim, covers};
use crate::inspect::words::{Words, contains};
use crate::inspect::{Inspection, Log, Pair, Track};
use fusion_core::geometry::so3::wrap_angle;
use fusion_core::math;
use toml_edit::Value;

/// Positions with smaller differences between fixes are of centimetre grade \[m\].
const PRECISE: f64 = 0.05;

impl Inspection {
    /// The kinds of signals that judge the filter.
    pub(super) fn reference_kinds(&self, k: usize) -> Vec<Kind> {
        let log = &self.logs[k];
        let is_file = self.reference.as_ref().is_some_and(|(r, _)| *r == k);
        let is_room = log.has(Quaternion) && is_local(log);
        let attitude = if log.has(Quaternion) && (is_file || is_room) {
            Some(Quaternion)
        } else {
            (log.has(Euler) && is_file).then_some(Euler)
        };
        let velocity = (!log.has_flat_velocity()).then_some(Velocity);
        let position_sigma = self.judges_with_reported(k).then_some(PositionSigma);
        let attitude_sigma = attitude.filter(|kind| *kind == Quaternion).map(|_| AttitudeSigma);
        let all = [
            Some(place(log)),
            velocity,
            attitude,
            attitude_sigma,
            position_sigma,
            Some(VelocitySigma),
        ];
        let sigma_of = |kind| kind != VelocitySigma || velocity.is_some() && log.has(Velocity);
        all.into_iter().flatten().filter(|kind| log.has(*kind) && sigma_of(*kind)).collect()
    }

    /// Whether the reported 1σ of the positions holds for their difference from the estimate. It does not for fixes of
    /// the receiver that the filter uses, if both share a slow error.
    pub(super) fn judges_with_reported(&self, k: usize) -> bool {
        let log = &self.logs[k];
        let is_shared = |(own, track): &(usize, Track)| *own == k && self.is_slow(log, track);
        let is_withheld = self.reference.is_none() && self.position.as_ref().is_some_and(is_shared);
        log.has(PositionSigma) && !is_withheld
    }

    /// Whether positions have a height.
    pub(super) fn has_height(&self) -> bool {
        self.position.as_ref().is_some_and(|(k, _)| {
            let log = &self.logs[*k];
            log.signal(place(log)).is_some_and(|s| s.columns.len() > 2)
        })
    }

    /// 1σ of the white part of a position, horizontal and vertical \[m\], and why.
    pub(super) fn white(&self, log: &Log, track: &Track) -> (f64, String) {
        if is_local(log) {
            // Acoustic fixes and cameras: neighbours share an error that the scatter does not show.
            let white = (3.0 * track.scatter).max(0.02);
            return (
                white,
                format!("guessed: three times the scatter of neighbouring fixes, {:.3} m", track.scatter),
            );
        }
        match track.claimed {
            Some(c) if c < PRECISE => ((2.0 * c).max(0.02), format!("guessed: twice the 1σ reported, {c:.3} m")),
            _ => (
                track.scatter.max(0.2),
                format!("guessed: neighbouring fixes scatter by {:.3} m; 0.2 m at least", track.scatter),
            ),
        }
    }

    /// The total 1σ of a position \[m\].
    pub(super) fn whole(&self, log: &Log, track: &Track) -> f64 {
        let (white, _) = self.white(log, track);
        if self.is_slow(log, track) { math::hypot(white, 1.5) } else { white }
    }

    /// The 1σ of the first fix: `times` the 1σ of a fix. A slow error that is a state has its own 1σ.
    pub(super) fn first_sigma(&self, draft: &mut Draft, times: f64, why: &str) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        if !self.is_slow(log, track) {
            draft.guess("position_sigma", format!("{:.2} m", times * self.whole(log, track)), why);
        }
    }

    /// Whether the error of a position is slow: single-point GNSS.
    fn is_slow(&self, log: &Log, track: &Track) -> bool {
        !is_local(log) && track.claimed.is_none_or(|c| c >= PRECISE)
    }

    /// The position and, if reported, the velocity, as sensors on `gnss`.
    /// `wander` is the random walk of the process velocity in the plane \[m/s/√s\], if the design declares it.
    pub(super) fn position_sensors(&self, draft: &mut Draft, is_moving: bool, wander: Option<f64>) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        let (white, why) = self.white(log, track);
        draft.part("gnss position");
        let is_flat = !self.has_height() && !is_local(log);
        let kind = match (is_local(log), is_flat) {
            (true, _) => "usbl_position",
            (false, true) => "horizontal_position",
            (false, false) => "gnss_position",
        };
        draft.set("type", kind);
        if !is_flat && (!self.has_height() || !is_moving) {
            draft.set("horizontal", true);
        }
        let arm = is_moving && track.is_reported;
        if arm {
            state(draft, "lever_arm", list([0, 0, 0]), "1 m");
        }
        self.offset_of_positions(draft, arm);
        if self.is_slow(log, track) {
            // A vehicle at foot speed stays near the same houses, and its odometer shows their effect on the fixes.
            draft.set("bias.correlation_time", if is_moving { "600 s" } else { "60 s" });
        }
        match self.claimed_position() {
            Some(claim) => from_source(draft, claim, &[white; 3], track.scatter, "m", &why),
            None => {
                draft.set("noise.sigma", format!("{white:.3} m"));
                draft.reason("noise", &why);
            }
        }
        if let Some(apart) = track.apart {
            draft.set("gate.type", "hypotheses");
            draft.set("gate.reach", format!("{apart:.0} m"));
            draft.set("gate.speed", format!("{:.1} m/s", track.top_speed().max(0.5)));
            let mut why = "guessed: two tracks in one file, which are so far apart; one of them is false".to_owned();
            if let Some(wander) = wander {
                draft.set("gate.wander", format!("{wander:.2} m/s/sqrt(s)"));
                why += "; `wander`: as the velocity of the process changes";
            }
            draft.reason("gate", &why);
        } else if is_local(log) {
            draft.set("gate.type", "nis");
            draft.set("gate.probability", 0.997);
            draft.reason("gate", "guessed: fixes of this kind have outliers");
        }
        if track.is_reported && is_moving {
            self.velocity_sensor(draft, log, track);
        }
    }

    /// The time offset of positions. `is_judged`: other fixes of the same receiver judge the filter.
    fn offset_of_positions(&self, draft: &mut Draft, is_judged: bool) {
        // If fixes of the same receiver judge a vehicle that turns as its course does, the stamps of the receiver
        // define the time.
        let (late, sigma, why) = if let Some(late) = self.late_position().filter(|_| is_judged) {
            let why = "guessed: positions are smoothed less than velocities, and are less late";
            (late, self.lag_sigma(), why)
        } else if self.is_shifted() {
            let why = "guessed: the clocks were brought together by velocities, which are late. Add what is found, with its sign, to `offset` in \
                       [source.imu]; then write `time_offset = 0` here";
            (self.lag().unwrap_or_default(), self.lag_sigma().max(0.2), why)
        } else {
            return;
        };
        state(draft, "time_offset", format!("{late:.2} s"), format!("{sigma:.2} s"));
        draft.reason("time_offset", why);
    }

    /// The 1σ that a receiver reports of its positions, if the filter uses it as their noise. It does not if the 1σ
    /// contains a slow error that is a state.
    fn claimed_position(&self) -> Option<Claim> {
        let (k, track) = self.position.as_ref()?;
        let log = &self.logs[*k];
        let is_whole = self.has_height() && !self.is_slow(log, track);
        track.claims[0].filter(|_| is_whole)
    }

    /// Whether the stamps of the unit were shifted to match the stamps of the positions.
    fn is_shifted(&self) -> bool {
        let clock = self.imu.as_ref().and_then(|(k, _)| self.logs[*k].clock.as_ref());
        clock.is_some_and(|clock| clock.shift != 0.0)
    }

    fn velocity_sensor(&self, draft: &mut Draft, log: &Log, track: &Track) {
        let log = self.velocity.map_or(log, |k| &self.logs[k]);
        draft.part("gnss velocity");
        let is_flat = log.has_flat_velocity();
        draft.set("type", if is_flat { "horizontal_velocity" } else { "gnss_velocity" });
        draft.set("source", self.velocity_source());
        if let Some(lag) = self.lag() {
            state(draft, "time_offset", format!("{lag:.2} s"), format!("{:.2} s", self.lag_sigma()));
            let why = if self.is_late_by_force() {
                "guessed: accelerations of the track against the length of the force, alike in every third of the log"
            } else if self.drift().is_some() {
                "guessed: rate of the course against the gyros, at the beginning: the `scale` in [source.imu] takes out how it changes"
            } else {
                "guessed: rate of the course against the gyros"
            };
            draft.reason("time_offset", why);
        }
        let claimed = log.values(VelocitySigma).map(|s| median(s.iter().map(|s| 0.5 * (s[0] + s[1]))));
        // Neighbouring fixes share a part of their error, which their scatter does not show.
        let scatter = 3.0 * track.velocity_scatter;
        let (sigma, why) = match claimed {
            Some(c) if scatter.is_nan() || scatter >= c => (c.max(0.05), format!("guessed: the 1σ reported, {c:.3} m/s")),
            _ if scatter.is_finite() => (
                scatter.clamp(0.05, 0.5),
                format!(
                    "guessed: three times the scatter of neighbouring velocities, {:.3} m/s",
                    track.velocity_scatter
                ),
            ),
            _ => (0.1, "guessed: what receivers usually reach".to_owned()),
        };
        let each = &[sigma, sigma, 2.0 * sigma][..if is_flat { 2 } else { 3 }];
        if let Some(claim) = track.claims[1] {
            from_source(draft, claim, each, track.velocity_scatter, "m/s", &why);
        } else {
            draft.set("noise.sigma", list(each.iter().map(|sigma| format!("{sigma:.3} m/s"))));
            draft.reason("noise", &why);
        }
        if track.agreement.is_some_and(|agreement| agreement[2] < 0.0) {
            draft.note("The reported vertical velocity runs against the height: is it up instead of down?");
        }
    }

    /// Whether only the length of the force gives the latency of velocities.
    fn is_late_by_force(&self) -> bool {
        self.pair.is_some_and(|p| !p.agrees() && p.by_force.is_some())
    }

    /// The assumed latency of positions, if a design declares it \[s\].
    pub(super) fn late_position(&self) -> Option<f64> {
        let lag = self.lag().filter(|_| self.reference.is_some() || self.is_late_by_force());
        lag.map(|lag| 0.3 * lag.max(0.0))
    }

    /// The latency of velocities, if it is known \[s\]; with a scaled unit clock, the rest of it.
    pub(super) fn lag(&self) -> Option<f64> {
        let pair = self.pair?;
        if !pair.agrees() {
            return pair.by_force;
        }
        let clock = self.logs[self.imu.as_ref()?.0].clock.as_ref()?;
        Some(match (self.drift(), pair.lags) {
            (Some(scale), Some((first, _))) => {
                let (begin, end) = clock.span();
                let middle = begin + (end - begin) / 6.0 - self.epoch().unwrap_or(0.0);
                first - (scale - 1.0) * middle
            }
            _ => pair.lag,
        })
    }

    /// 1σ of [`Self::lag`] \[s\]. The course of an antenna that is ahead of the unit by d turns d/v earlier.
    fn lag_sigma(&self) -> f64 {
        /// The 1σ of an unknown lever arm \[m\], and of a lag without one \[s\].
        const ARM: f64 = 1.0;
        const USUAL: f64 = 0.05;
        let speed = self.pair.filter(Pair::agrees).map_or(f64::INFINITY, |pair| pair.speed);
        math::hypot(USUAL, ARM / speed)
    }

    /// The sources of the positions, and of velocities in a separate file.
    pub(super) fn position_source(&self, draft: &mut Draft) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        let is_withheld = self.reference.is_none() && track.rate() > WITHHELD;
        let thinned = |every: usize| is_withheld.then_some(("keep.every", every));
        if is_withheld {
            draft.section("positions: about one a second is used, the others judge");
        }
        let of_position = self.claimed_position().map(|_| PositionSigma);
        let own = track.claims[1].filter(|_| self.velocity.is_none()).map(|_| VelocitySigma);
        let kinds: Vec<Kind> = [Some(place(log)), Some(Velocity), of_position, own].into_iter().flatten().collect();
        self.source(draft, "gnss", *k, &kinds, thinned(track_stride(log, track)));
        if let Some(velocity) = self.velocity {
            let every = math::round(self.logs[velocity].rate()).max(1.0) as usize;
            let of_velocity = track.claims[1].map(|_| VelocitySigma);
            let kinds: Vec<Kind> = [Some(Velocity), of_velocity].into_iter().flatten().collect();
            self.source(draft, self.velocity_source(), velocity, &kinds, thinned(every));
        }
    }

    /// A barometer, if there is an air pressure and positions have a height.
    pub(super) fn barometer(&self, draft: &mut Draft) {
        let is_wet = self.with(Depth).is_some() || self.with(BodyVelocity).is_some();
        let Some((k, (_, track))) = self
            .with(Pressure)
            .zip(self.position.as_ref())
            .filter(|_| !is_wet && self.has_height())
        else {
            return;
        };
        let log = &self.logs[k];
        let (Some(values), Some(origin)) = (log.values(Pressure), track.origin) else {
            return;
        };
        let pressures: Vec<f64> = values.iter().map(|v| v[0]).collect();
        // The reading of a barometer at the first position, reduced to height zero of the standard atmosphere (ISO
        // 2533).
        let at_sea = median(pressures.iter().take(10).copied()) / math::powf(1.0 - 6.5e-3 * origin[2] / 288.15, 5.255_88);
        let changed: Vec<f64> = pressures.windows(2).filter(|w| w[0] != w[1]).map(|w| w[1]).collect();
        let scatter = scatter(&changed);
        // Against the heights of the track: wind and speed also change the pressure, but not from row to row.
        let moved = against_heights(log.stamps(), &pressures, track);
        let sigma = if scatter.is_finite() { scatter.max(moved).max(3.0) } else { 10.0 };
        draft.part("barometer");
        draft.set("sea_level_pressure.initial", format!("{:.2} hPa", 0.01 * at_sea));
        draft.set("noise.sigma", format!("{sigma:.1} Pa"));
        self.source(draft, "barometer", k, &[Pressure], None);
    }

    /// A recorded heading that follows the course, and a magnetometer that reads the Earth's field.
    pub(super) fn compasses(&self, draft: &mut Draft) {
        if let Some(k) = self.recorded_heading() {
            draft.part("heading");
            let left = self.yaw.map_or(0.0, |y| -past_quarter(y.offset.to_degrees()));
            draft.set("bias.initial", format!("{left:.1} deg"));
            self.source(draft, "heading", k, &[Heading], None);
        }
        let Some((k, field)) = self.earth_field() else { return };
        if self.told() == super::Told::Field {
            draft.part("compass for the start");
        }
        draft.part("magnetometer");
        draft.set("strength.initial", format!("{:.1} uT", 1e6 * field.strength));
        draft.set("inclination.initial", format!("{:.1} deg", field.dip.to_degrees()));
        // The time of a row within its interval is not known.
        let turned = self.imu.as_ref().map_or(0.0, |(_, imu)| imu.turning * 0.5 / self.logs[k].rate());
        let sigma = (1e6 * field.strength * turned.min(1.0)).max(field.scatter * 1e6).max(1.0);
        draft.set("noise.sigma", format!("{sigma:.1} uT"));
        self.source(draft, "magnetometer", k, &[MagneticField], None);
    }

    /// A speed ahead: from wheels, or from a log that measures the speed through the water.
    pub(super) fn log_or_wheels(&self, draft: &mut Draft) {
        let Some(k) = self.with(Speed) else { return self.tracks(draft) };
        if let Some(current) = self.current(Speed) {
            draft.part("speed through water");
            drift(draft, &self.why_water(Speed, current));
            let kinds = self.with_reported(draft, k, Speed);
            self.source(draft, "log", k, &kinds, None);
            draft.part("leeway");
        } else {
            draft.part("speed of wheels");
            let kinds = self.with_reported(draft, k, Speed);
            self.source(draft, "odometer", k, &kinds, None);
        }
    }

    /// The kinds that the current sensor reads: its own, and the 1σ that the log reports of it. The noise of the sensor is
    /// then that of each row, and its usual noise is added.
    pub(super) fn with_reported(&self, draft: &mut Draft, k: usize, kind: Kind) -> Vec<Kind> {
        let sigma = kind.sigma().filter(|sigma| covers(&self.logs[k], *sigma, kind));
        if sigma.is_some() {
            draft.set("noise.from_source", true);
            draft.reason(
                "noise",
                "guessed: the covariance of each message, and the usual noise of such a sensor added",
            );
        }
        [Some(kind), sigma].into_iter().flatten().collect()
    }

    /// The height of the first fix, if the fixes have none.
    pub(super) fn first_height(&self, draft: &mut Draft) {
        let is_local = self.position.as_ref().is_some_and(|(k, _)| is_local(&self.logs[*k]));
        if !self.has_height() && !is_local {
            draft.set("height", "0 m");
        }
    }

    /// Why a speed is taken as a speed through the water: the current that was found, or the name.
    fn why_water(&self, of: Kind, current: [f64; 2]) -> String {
        if self.found_current(of).is_some() {
            return through_water(current);
        }
        "guessed: by its name a speed through the water; this log does not give the current".to_owned()
    }

    /// Returns true if a velocity over ground is measured: without one, a current is not identifiable.
    fn knows_ground(&self) -> bool {
        self.position.as_ref().is_some_and(|(_, track)| track.is_reported)
    }

    /// A Doppler log and a depth, if there are any; `is_planar`: the positions are used without their height.
    pub(super) fn water(&self, draft: &mut Draft, is_planar: bool) {
        if let Some(k) = self.with(BodyVelocity) {
            let (current, is_ground) = (self.current(BodyVelocity), sees_ground(&self.logs[k]));
            let name = if let Some(current) = current {
                draft.part("water log");
                drift(draft, &self.why_water(BodyVelocity, current));
                "water_log"
            } else {
                draft.part("dvl");
                if !(is_ground || self.is_over_ground(BodyVelocity)) && self.knows_ground() {
                    let why = "guessed: neither a name nor the way tells the velocity over ground from that through the water; for a Doppler log \
                               that sees the bottom delete this line";
                    drift(draft, why);
                }
                "dvl"
            };
            if let Some(angle) = self.left_of_log() {
                draft.set(
                    "mounting",
                    list([Value::from(0), 0.into(), format!("{:.0} deg", angle.to_degrees()).into()]),
                );
                let why = "guessed: there the changes of this velocity agree with the forces of the unit";
                draft.reason("mounting", why);
            }
            let kinds = self.with_reported(draft, k, BodyVelocity);
            self.source(draft, name, k, &kinds, None);
        }
        let in_position = self.position.as_ref().is_some_and(|(k, _)| is_local(&self.logs[*k]));
        if let Some(k) = self.with(Depth).filter(|_| !in_position || is_planar) {
            draft.part("depth");
            if in_position {
                draft.leave_out("surface");
                draft.set("noise.sigma", "5 cm");
                draft.reason("noise", "guessed: pressure, and waves; depth is counted from the `origin`");
            } else if let Some(sigma) = white_depth(&self.logs[k]).filter(|sigma| *sigma > USUAL_DEPTH) {
                draft.set("noise.sigma", format!("{sigma:.3} m"));
                draft.reason("noise", "guessed: neighbouring depths scatter by it");
            }
            self.source(draft, "depth", k, &[Depth], None);
        }
    }

    /// The angle of x of a velocity log to the right of the declared forward axis of the unit, if it is not zero by chance
    /// \[rad\].
    fn left_of_log(&self) -> Option<f64> {
        /// Normal errors are larger once in 370 times.
        const CHANCE: f64 = 3.0;
        let turned = self.turned?;
        let left = wrap_angle(turned.angle - f64::from(self.quarters()) * core::f64::consts::FRAC_PI_2);
        // The bias of the log contains what rounding leaves.
        let is_rounded_off = left.abs() < 0.5_f64.to_radians();
        (left.abs() > CHANCE * turned.sigma && !is_rounded_off).then_some(left)
    }
}

/// The noise of the template, 1σ of a depth by pressure \[m\].
const USUAL_DEPTH: f64 = 0.02;

/// The white scatter of a depth, with the error of its rounding, 1σ \[m\].
fn white_depth(log: &Log) -> Option<f64> {
    let depths: Vec<f64> = log.values(Depth)?.into_iter().map(|v| v[0]).collect();
    let rounding = resolution(depths.iter().copied()) / math::sqrt(12.0_f64);
    Some(scatter(&depths).max(rounding)).filter(|sigma| sigma.is_finite())
}

/// A parameter as a state.
fn state(draft: &mut Draft, key: &str, initial: impl Into<Value>, sigma: impl Into<Value>) {
    draft.set(&format!("{key}.estimate"), true);
    draft.set(&format!("{key}.initial"), initial);
    draft.set(&format!("{key}.sigma"), sigma);
}

/// The noise of a sensor as its source reports it, row by row. `sigma` is the assumed noise along each axis at the
/// usual report. The part that is not reported is added, and at least the `scatter` of neighbours.
fn from_source(draft: &mut Draft, claim: Claim, sigma: &[f64], scatter: f64, unit: &str, why: &str) {
    /// If a receiver reports zero, the filter needs some noise: the last digit of most logs.
    const LEAST: f64 = 1e-3;
    let least = scatter.max(LEAST);
    // A receiver that reports less than the scatter of its neighbours is optimistic. One that reports more than its
    // assumed noise is conservative.
    let across = 0.5 * (claim.median[0] + claim.median[1]);
    let careful = sigma[0] / across;
    let scale = if claim.times > 1.0 { claim.times } else { careful.min(1.0) };
    let rest = sigma.iter().zip([across, across, claim.median[2]]);
    let rest = rest.map(|(sigma, reported)| math::sqrt((math::powi(*sigma, 2) - math::powi(scale * reported, 2)).max(0.0)).max(least));
    draft.set("noise.from_source", true);
    draft.set("noise.scale", number(&format!("{scale:.2}")));
    draft.set("noise.sigma", list(rest.map(|rest| format!("{rest:.3} {unit}"))));
    let why = format!("{why}; in each row as the receiver reports it; raise `scale` where NIS stays too large");
    draft.reason("noise", &why);
}

/// The scatter of pressures against the heights of a track over five seconds, 1σ of one \[Pa\]; zero if it is unknown.
fn against_heights(t: &[f64], pressures: &[f64], track: &Track) -> f64 {
    /// The time between two compared pressures [s].
    const AFTER: f64 = 5.0;
    /// The height over which the pressure of air changes by a factor of e, at 15 °C (ISO 2533) [m].
    const SCALE: f64 = 8435.0;
    let height = |at: f64| {
        let k = track.t.partition_point(|t| *t <= at).checked_sub(1)?;
        let (from, to) = (track.t[k], *track.t.get(k + 1)?);
        let share = (at - from) / (to - from);
        let down = track.position[k][2] + share * (track.position[k + 1][2] - track.position[k][2]);
        (to - from < 2.0).then_some(-down)
    };
    let mut from = 0;
    let off = (0..t.len()).filter_map(|to| {
        while t[to] - t[from] >= AFTER {
            from += 1;
        }
        let (at, before) = (t[to], t[from.checked_sub(1)?]);
        let climbed = height(at)? - height(before)?;
        let expected = pressures[from - 1] * math::exp(-climbed / SCALE);
        (at - before < 1.5 * AFTER).then(|| (pressures[to] - expected).abs() / math::sqrt(2.0_f64))
    });
    let scatter = by_half(off.collect::<Vec<_>>());
    if scatter.is_finite() { scatter } else { 0.0 }
}

/// The current as a state.
fn drift(draft: &mut Draft, why: &str) {
    let level = |each: &str| list([Value::from(each), each.into(), 0.into()]);
    state(draft, "current", list([0, 0, 0]), level("0.5 m/s"));
    draft.set("current.random_walk", level("5 mm/s/sqrt(s)"));
    draft.reason("current", why);
}

/// Why a speed is taken as a speed through the water, if the current is found.
fn through_water([north, east]: [f64; 2]) -> String {
    format!(
        "guessed: a speed through the water, for it agrees with that over ground only if a current of {north:.2} m/s north, {east:.2} m/s \
         east is taken off"
    )
}

/// Whether the name of a file, or of a column, says that a velocity is over ground.
fn sees_ground(log: &Log) -> bool {
    const GROUND: [&str; 7] = ["dvl", "doppler", "bottom", "bt", "ground", "sog", "odom"];
    let names = log.signal(BodyVelocity).map_or_else(Vec::new, |s| s.names(&log.table));
    let says = |name: &String| contains(&Words::of(name).stem, &GROUND);
    let file = log.name();
    says(&file.split('.').next().unwrap_or_default().to_owned()) || names.iter().any(says)
}

/// The part of an angle \[deg\] beyond whole quarter turns.
pub(super) fn past_quarter(angle: f64) -> f64 {
    angle - 90.0 * math::round(angle / 90.0)
}

/// The kind of position in a log.
pub(super) fn place(log: &Log) -> Kind {
    if log.has(Geodetic) { Geodetic } else { Local }
}
