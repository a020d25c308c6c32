//! The tables of sensors: positions and all other aiding.

use super::toml::Text;
use super::{WITHHELD, is_local, track_stride};
use crate::inspect::numbers::median;
use crate::inspect::signal::Kind::{
    self, BodyVelocity, Depth, Euler, Geodetic, Heading, Local, MagneticField, PositionSigma, Pressure, Quaternion, Speed, Velocity,
    VelocitySigma,
};
use crate::inspect::track::Claim;
use crate::inspect::words::{Words, contains};
use crate::inspect::{Inspection, Log, Track};

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
        let all = [Some(place(log)), velocity, attitude, position_sigma, Some(VelocitySigma)];
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
        if self.is_slow(log, track) { white.hypot(1.5) } else { white }
    }

    /// Writes the 1σ of the first fix: `times` the 1σ of a fix. With a slow error as a state it writes none.
    pub(super) fn first_sigma(&self, text: &mut Text, times: f64, why: &str) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        if !self.is_slow(log, track) {
            text.line(&format!("position_sigma = \"{:.2} m\"", times * self.whole(log, track)), why);
        }
    }

    /// Whether the error of a position is slow: single-point GNSS.
    fn is_slow(&self, log: &Log, track: &Track) -> bool {
        !is_local(log) && track.claimed.is_none_or(|c| c >= PRECISE)
    }

    /// The position and, if reported, the velocity, as sensors on `gnss`.
    /// `wander` is the random walk of the process velocity in the plane \[m/s/√s\], if the design declares it.
    pub(super) fn position_sensors(&self, text: &mut Text, is_moving: bool, wander: Option<f64>) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        let (white, why) = self.white(log, track);
        text.table("sensor.gnss_position");
        let is_flat = !self.has_height() && !is_local(log);
        let kind = match (is_local(log), is_flat) {
            (true, _) => "usbl_position",
            (false, true) => "horizontal_position",
            (false, false) => "gnss_position",
        };
        text.quoted("type", kind);
        text.quoted("source", "gnss");
        if !is_flat && (!self.has_height() || !is_moving) {
            text.line("horizontal = true", "guessed: no height, or one that is not needed");
        }
        let arm = is_moving && track.is_reported;
        if arm {
            text.line(
                "lever_arm = { estimate = true, initial = [0, 0, 0], sigma = \"1 m\" }",
                "guessed: the antenna is within a metre or two of the unit; measure it",
            );
        }
        let lag = self.lag();
        // If fixes of the same receiver judge a vehicle that turns as its course does, the stamps of the receiver
        // define the time.
        if let Some(late) = self.late_position().filter(|_| arm) {
            let share = format!("time_offset = {{ estimate = true, initial = \"{late:.2} s\", sigma = \"50 ms\" }}");
            text.line(&share, "guessed: positions are smoothed less than velocities, and are less late");
        } else if self.is_shifted() {
            let lag = lag.unwrap_or_default();
            text.line(
                &format!("time_offset = {{ estimate = true, initial = \"{lag:.2} s\", sigma = \"0.2 s\" }}"),
                "guessed: the clocks were brought together by velocities, which are late. Add what is found, with its sign, to `offset` in \
                 [source.imu]; then write `time_offset = 0` here",
            );
        }
        if self.is_slow(log, track) {
            // A vehicle at foot speed stays near the same houses, and its odometer shows their effect on the fixes.
            let time = if is_moving { 600 } else { 60 };
            text.line(
                &format!("bias = {{ estimate = true, initial = [0, 0, 0], sigma = [\"1.5 m\", \"1.5 m\", \"2 m\"], correlation_time = \"{time} s\" }}"),
                "guessed: the slow error of single-point GNSS (configs/parts/gnss/single-point.toml); nothing here tells it",
            );
        }
        match self.claimed_position() {
            Some(claim) => text.line(
                &from_source(claim, &[white; 3], track.scatter, "m"),
                &format!("{why}; in each row as the receiver reports it; raise `scale` where NIS stays too large"),
            ),
            None => text.line(&format!("noise = {{ sigma = \"{white:.3} m\" }}"), &why),
        }
        if let Some(apart) = track.apart {
            text.line(
                &format!(
                    "gate = {{ type = \"hypotheses\", reach = \"{apart:.0} m\", speed = \"{:.1} m/s\"{} }}",
                    track.top_speed().max(0.5),
                    wander.map_or_else(String::new, |wander| format!(", wander = \"{wander:.2} m/s/sqrt(s)\""))
                ),
                wander.map_or(
                    "guessed: two tracks in one file, which are so far apart; one of them is false",
                    |_| "guessed: two tracks in one file, which are so far apart; one of them is false; `wander`: as the velocity of the process changes",
                ),
            );
        } else if is_local(log) {
            text.line(
                "gate = { type = \"nis\", probability = 0.997 }",
                "guessed: fixes of this kind have outliers",
            );
        }
        if track.is_reported && is_moving {
            self.velocity_sensor(text, log, track, lag);
        }
    }

    /// The 1σ that a receiver reports of its positions, if the filter uses it as their noise. It does not if the 1σ
    /// contains a slow error that is a state.
    fn claimed_position(&self) -> Option<Claim> {
        let (k, track) = self.position.as_ref()?;
        let log = &self.logs[*k];
        let is_whole = self.has_height() && !is_local(log) && !self.is_slow(log, track);
        track.claims[0].filter(|_| is_whole)
    }

    /// Whether the stamps of the unit were shifted to match the stamps of the positions.
    fn is_shifted(&self) -> bool {
        let clock = self.imu.as_ref().and_then(|(k, _)| self.logs[*k].clock.as_ref());
        clock.is_some_and(|clock| clock.shift != 0.0)
    }

    fn velocity_sensor(&self, text: &mut Text, log: &Log, track: &Track, lag: Option<f64>) {
        let log = self.velocity.map_or(log, |k| &self.logs[k]);
        text.table("sensor.gnss_velocity");
        let is_flat = log.has_flat_velocity();
        text.quoted("type", if is_flat { "horizontal_velocity" } else { "gnss_velocity" });
        text.quoted("source", self.velocity_source());
        text.line("lever_arm = { shared = \"gnss_position.lever_arm\" }", "");
        if let Some(lag) = lag {
            let offset = format!("time_offset = {{ estimate = true, initial = \"{lag:.2} s\", sigma = \"50 ms\" }}");
            let why = if self.is_late_by_force() {
                "guessed: accelerations of the track against the length of the force, alike in every third of the log"
            } else if self.drift().is_some() {
                "guessed: rate of the course against the gyros, at the beginning: the `scale` in [source.imu] takes out how it changes"
            } else {
                "guessed: rate of the course against the gyros"
            };
            text.line(&offset, why);
        }
        let claim = track.claims[1];
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
        if let Some(claim) = claim {
            let axes = if is_flat { 2 } else { 3 };
            text.line(
                &from_source(claim, &[sigma, sigma, 2.0 * sigma][..axes], track.velocity_scatter, "m/s"),
                &format!("{why}; in each row as the receiver reports it; raise `scale` where NIS stays too large"),
            );
            return self.vertical_runs_against(text, track);
        }
        let third = if is_flat {
            String::new()
        } else {
            format!(", \"{:.3} m/s\"", 2.0 * sigma)
        };
        text.line(
            &format!("noise = {{ sigma = [\"{sigma:.3} m/s\", \"{sigma:.3} m/s\"{third}] }}"),
            &why,
        );
        self.vertical_runs_against(text, track);
    }

    fn vertical_runs_against(&self, text: &mut Text, track: &Track) {
        let downs = track.agreement.map_or(1.0, |a| a[2]);
        if downs < 0.0 {
            text.comment("The reported vertical velocity runs against the height: is it up instead of down?");
        }
    }

    /// Whether only the length of the force gives the latency of velocities.
    fn is_late_by_force(&self) -> bool {
        self.pair.is_some_and(|p| p.correlation.abs() <= 0.8 && p.by_force.is_some())
    }

    /// The assumed latency of positions, if a design declares it \[s\].
    pub(super) fn late_position(&self) -> Option<f64> {
        let lag = self.lag().filter(|_| self.reference.is_some() || self.is_late_by_force());
        lag.map(|lag| 0.3 * lag.max(0.0))
    }

    /// The latency of velocities, if it is known \[s\]; with a scaled unit clock, the rest of it.
    pub(super) fn lag(&self) -> Option<f64> {
        let pair = self.pair?;
        if pair.correlation.abs() <= 0.8 {
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

    /// The sources of the positions, and of velocities in a separate file.
    pub(super) fn position_source(&self, text: &mut Text) {
        let Some((k, track)) = &self.position else { return };
        let log = &self.logs[*k];
        let is_withheld = self.reference.is_none() && track.rate() > WITHHELD;
        let thinned = |every: usize| {
            if is_withheld {
                format!("keep = {{ every = {every} }}")
            } else {
                String::new()
            }
        };
        if is_withheld {
            text.section("positions: about one a second is used, the others judge");
        }
        let of_position = self.claimed_position().map(|_| PositionSigma);
        let own = track.claims[1].filter(|_| self.velocity.is_none()).map(|_| VelocitySigma);
        let kinds: Vec<Kind> = [Some(place(log)), Some(Velocity), of_position, own].into_iter().flatten().collect();
        self.source(text, "gnss", *k, &kinds, &thinned(track_stride(log, track)));
        if let Some(velocity) = self.velocity {
            let every = self.logs[velocity].rate().round().max(1.0) as usize;
            let of_velocity = track.claims[1].map(|_| VelocitySigma);
            let kinds: Vec<Kind> = [Some(Velocity), of_velocity].into_iter().flatten().collect();
            self.source(text, self.velocity_source(), velocity, &kinds, &thinned(every));
        }
    }

    /// A barometer, if there is an air pressure and positions have a height.
    pub(super) fn barometer(&self, text: &mut Text) {
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
        let at_sea = median(pressures.iter().take(10).copied()) / (1.0 - 6.5e-3 * origin[2] / 288.15).powf(5.255_88);
        let changed: Vec<f64> = pressures.windows(2).filter(|w| w[0] != w[1]).map(|w| w[1]).collect();
        // The middle of three in a row with white errors, as for positions; a normal number is below 0.674 σ half of
        // the time.
        let off = changed.windows(3).map(|p| (p[1] - 0.5 * (p[0] + p[2])).abs());
        let scatter = median(off) / 0.674 / 1.5_f64.sqrt();
        // Against the heights of the track: wind and speed also change the pressure, but not from row to row.
        let moved = against_heights(log.stamps(), &pressures, track);
        let sigma = if scatter.is_finite() { scatter.max(moved).max(3.0) } else { 10.0 };
        text.table("sensor.barometer");
        text.line("type = \"barometer\"\nsource = \"barometer\"", "");
        text.line(
            &format!(
                "sea_level_pressure = {{ estimate = true, initial = \"{:.2} hPa\", sigma = \"2 hPa\", random_walk = \"2 Pa/sqrt(s)\" }}",
                0.01 * at_sea
            ),
            "guessed: so that the first pressure is that of the first height; the weather moves it",
        );
        text.line(
            &format!("noise = {{ sigma = \"{sigma:.1} Pa\" }}"),
            "guessed: the scatter of neighbouring pressures, or that against the heights of the positions over 5 s; 3 Pa at least",
        );
        self.source(text, "barometer", k, &[Pressure], "");
    }

    /// A recorded heading that follows the course, and a magnetometer that reads the Earth's field.
    pub(super) fn compasses(&self, text: &mut Text) {
        if let Some(k) = self.recorded_heading() {
            text.table("sensor.heading");
            text.line("type = \"heading\"\nsource = \"heading\"", "");
            let left = self.yaw.map_or(0.0, |y| -past_quarter(y.offset.to_degrees()));
            text.line(
                &format!("bias = {{ estimate = true, initial = \"{left:.1} deg\", sigma = \"10 deg\" }}"),
                "guessed: heading minus course; declination, and how it is mounted",
            );
            text.line(
                "deviation = { sin = { estimate = true, initial = 0, sigma = \"3 deg\" }, cos = { estimate = true, initial = 0, sigma = \"3 deg\" } }",
                "guessed: iron",
            );
            text.line(
                "noise = { sigma = \"5 deg\" }",
                "guessed: a compass in motion, whose rows share their error",
            );
            self.source(text, "heading", k, &[Heading], "");
        }
        let Some((k, field)) = self.earth_field() else { return };
        if self.told() == super::Told::Field {
            text.table("stage.compass");
            text.line("type = \"compass\"\nsource = \"magnetometer\"\nlevel_source = \"imu\"", "");
            text.line("rate = \"1 Hz\"", "for the start");
        }
        text.table("sensor.magnetometer");
        text.line("type = \"magnetometer\"\nsource = \"magnetometer\"", "");
        text.line(
            &format!(
                "strength = {{ estimate = true, initial = \"{:.1} uT\", sigma = \"3 uT\" }}",
                1e6 * field.strength
            ),
            "guessed: its median",
        );
        text.line(
            &format!(
                "inclination = {{ estimate = true, initial = \"{:.1} deg\", sigma = \"3 deg\" }}",
                field.dip.to_degrees()
            ),
            "guessed: its median below the plane across the specific force",
        );
        text.line(
            "declination = { estimate = true, initial = 0, sigma = \"15 deg\" }",
            "no file tells it: better give that of the place, from a map or a model of the field",
        );
        text.line(
            "hard_iron = { estimate = true, initial = [0, 0, 0], sigma = \"5 uT\" }",
            "guessed: a unit that is not calibrated in its vehicle",
        );
        // The time of a row within its interval is not known.
        let turned = self.imu.as_ref().map_or(0.0, |(_, imu)| imu.turning * 0.5 / self.logs[k].rate());
        let sigma = (1e6 * field.strength * turned.min(1.0)).max(field.scatter * 1e6).max(1.0);
        text.line(
            &format!("noise = {{ sigma = \"{sigma:.1} uT\" }}"),
            "guessed: how its length scatters, or how far fast turns move it in half an interval; 1 uT at least",
        );
        self.source(text, "magnetometer", k, &[MagneticField], "");
    }

    /// A speed ahead: from wheels, or from a log that measures the speed through the water.
    pub(super) fn log_or_wheels(&self, text: &mut Text) {
        let Some(k) = self.with(Speed) else { return };
        let current = self.current(Speed);
        let name = if current.is_some() { "log" } else { "odometer" };
        text.table(&format!("sensor.{name}"));
        text.line(&format!("type = \"odometer\"\nsource = \"{name}\""), "");
        text.line("scale = { estimate = true, initial = 0, sigma = \"3 %\" }", "guessed");
        if let Some(current) = current {
            drift(text, &self.why_water(Speed, current));
        } else {
            text.line(
                "mounting = { estimate = true, initial = [0, 0, 0], sigma = [0, \"5 deg\", \"8 deg\"] }",
                "guessed: mounted by hand",
            );
        }
        text.line(
            "noise = { sigma = \"0.1 m/s\" }",
            "guessed: slip, waves, and the arm from the unit to it",
        );
        self.source(text, name, k, &[Speed], "");
        if current.is_some() {
            text.table("stage.tick");
            text.line("type = \"periodic\"\nsource = \"imu\"\nrate = \"1 Hz\"", "");
            text.table("sensor.leeway");
            text.line("type = \"nonholonomic\"\nsource = \"tick\"\naxes = \"right\"", "");
            text.line("current = { shared = \"log.current\" }", "");
            text.line(
                "noise = { sigma = \"0.3 m/s\" }",
                "guessed: a hull hardly slips sideways through the water",
            );
        }
    }

    /// The height of the first fix, if the fixes have none.
    pub(super) fn first_height(&self, text: &mut Text) {
        let is_local = self.position.as_ref().is_some_and(|(k, _)| is_local(&self.logs[*k]));
        if !self.has_height() && !is_local {
            text.line("height = \"0 m\"", "guessed: no file tells it");
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
    pub(super) fn water(&self, text: &mut Text, is_planar: bool) {
        if let Some(k) = self.with(BodyVelocity) {
            let (current, is_ground) = (self.current(BodyVelocity), sees_ground(&self.logs[k]));
            let name = if current.is_some() { "water_log" } else { "dvl" };
            text.table(&format!("sensor.{name}"));
            text.quoted("type", "body_velocity");
            text.quoted("source", name);
            if let Some(current) = current {
                drift(text, &self.why_water(BodyVelocity, current));
            } else {
                if !(is_ground || self.is_over_ground(BodyVelocity)) && self.knows_ground() {
                    let why = "guessed: neither a name nor the way tells the velocity over ground from that through the water; for a Doppler log \
                               that sees the bottom delete this line";
                    drift(text, why);
                }
                text.line(
                    "bias = { estimate = true, initial = [0, 0, 0], sigma = [\"0.2 m/s\", \"0.2 m/s\", 0], correlation_time = \"120 s\" }",
                    "guessed: scale and mounting of a Doppler log are slow errors",
                );
            }
            text.line(
                "noise = { sigma = \"0.1 m/s\" }",
                "guessed: scatter of a Doppler log on a small vehicle",
            );
            text.line("gate = { type = \"nis\", probability = 0.999 }", "guessed: single pings fail");
            self.source(text, name, k, &[BodyVelocity], "");
        }
        let in_position = self.position.as_ref().is_some_and(|(k, _)| is_local(&self.logs[*k]));
        if let Some(k) = self.with(Depth).filter(|_| !in_position || is_planar) {
            text.table("sensor.depth");
            text.quoted("type", "depth");
            text.quoted("source", "depth");
            if in_position {
                text.line(
                    "noise = { sigma = \"5 cm\" }",
                    "guessed: pressure, and waves; depth is counted from the `origin`",
                );
            } else {
                text.line(
                    "surface = { estimate = true, initial = 0, sigma = \"1 m\" }",
                    "guessed: tide, and the zero of the sensor",
                );
                text.line("noise = { sigma = \"2 cm\" }", "guessed: usual for pressure");
            }
            self.source(text, "depth", k, &[Depth], "");
        }
    }
}

/// The noise of a sensor as its source reports it, row by row. `sigma` is the assumed noise along each axis at the
/// usual report. The part that is not reported is added, and at least the `scatter` of neighbours.
fn from_source(claim: Claim, sigma: &[f64], scatter: f64, unit: &str) -> String {
    /// If a receiver reports zero, the filter needs some noise: the last digit of most logs.
    const LEAST: f64 = 1e-3;
    let least = scatter.max(LEAST);
    // A receiver that reports less than the scatter of its neighbours is optimistic. One that reports more than its
    // assumed noise is conservative.
    let across = 0.5 * (claim.median[0] + claim.median[1]);
    let careful = sigma[0] / across;
    let scale = if claim.times > 1.0 { claim.times } else { careful.min(1.0) };
    let rest = sigma.iter().zip([across, across, claim.median[2]]);
    let rest = rest.map(|(sigma, reported)| (sigma.powi(2) - (scale * reported).powi(2)).max(0.0).sqrt().max(least));
    let rest: Vec<String> = rest.map(|rest| format!("\"{rest:.3} {unit}\"")).collect();
    format!(
        "noise = {{ from_source = true, scale = {scale:.2}, sigma = [{}] }}",
        rest.join(", ")
    )
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
        let expected = pressures[from - 1] * (-climbed / SCALE).exp();
        (at - before < 1.5 * AFTER).then(|| (pressures[to] - expected).abs() / 2.0_f64.sqrt())
    });
    // A normal number is below 0.674 σ half of the time.
    let scatter = median(off.collect::<Vec<_>>()) / 0.674;
    if scatter.is_finite() { scatter } else { 0.0 }
}

/// The current as a state.
fn drift(text: &mut Text, why: &str) {
    text.line(
        "current = { estimate = true, initial = [0, 0, 0], sigma = [\"0.5 m/s\", \"0.5 m/s\", 0], random_walk = [\"5 mm/s/sqrt(s)\", \"5 mm/s/sqrt(s)\", 0] }",
        why,
    );
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
    angle - 90.0 * (angle / 90.0).round()
}

/// The kind of position in a log.
pub(super) fn place(log: &Log) -> Kind {
    if log.has(Geodetic) { Geodetic } else { Local }
}
