//! The position of a transponder, from the measurements of an ultra-short-baseline transceiver under a ship.
//!
//! Position   p = p_a + C_sn (l_u − l_g) + C_sn C_us s,  s = r [cos δ cos β, cos δ sin β, sin δ]
//!            p_a ship antenna, C_sn ship attitude, l_g, l_u antenna and transceiver in the ship, C_us
//!            mounting of the transceiver, r slant range, β bearing from x towards y, δ depression below x-y
//! Covariance Σ = Σ_gps + A J diag(σr², σβ², σδ²) Jᵀ Aᵀ + [L×] C_sn Σ_att C_snᵀ [L×]ᵀ
//!            A = C_sn C_us, J = ∂s/∂(r, β, δ), L = C_sn (l_u − l_g + C_us s)
//! Time       a fix is valid when the transponder was heard: r/c + `delay` before the stamp of its row.
//!            Position and attitude of the ship are interpolated at this time, from a history of sufficient length.
//!            If they are missing for longer than `longest_gap`, there is no fix
//! Order      rows of the transceiver are seen at the earliest time at which they may be valid; rows of the
//!            ship are seen before that, so that both sides of a fix are available
//! Emits      position, its 1σ north, east, down, and the slant range
//! Not here   refraction; the lever arm of the transponder, which the sensor of the position has
//! Source     geometry as in any USBL; covariance by first-order propagation

use alloc::collections::VecDeque;
use fusion_core::geometry::so3;
use fusion_core::geometry::wgs84::Geodetic;
use fusion_core::literal;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Attitude, Manifold, View};
use fusion_core::time::{Time, nanos};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The inputs by number.
const TRANSCEIVER: usize = 0;

const SHIP_POSITION: usize = 1;

/// The places of antenna and transceiver in the ship, and the variances of the measurements.
#[derive(Clone, Debug, Literal)]
pub struct Geometry {
    /// From the antenna to the transceiver in the ship \[m\].
    arm: Vector3<f64>,
    /// Transceiver to ship.
    c_us: UnitQuaternion<f64>,
    /// Range, bearing, depression.
    acoustic: Vector3<f64>,
    antenna: Vector3<f64>,
    attitude: Vector3<f64>,
}

impl Geometry {
    /// From the antenna to the transponder in north, east, down \[m\], and its covariance, including that of the
    /// antenna.
    fn fix(&self, c_sn: &UnitQuaternion<f64>, [r, bearing, depression]: [f64; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let ((sb, cb), (sd, cd)) = (math::sin_cos(bearing), math::sin_cos(depression));
        let unit = Vector3::new(cd * cb, cd * sb, sd);
        let by_bearing = Vector3::new(-cd * sb, cd * cb, 0.0) * r;
        let by_depression = Vector3::new(-sd * cb, -sd * sb, cd) * r;
        let a = (c_sn * self.c_us).to_rotation_matrix();
        let j = a.matrix() * Matrix3::from_columns(&[unit, by_bearing, by_depression]);
        let away = c_sn * (self.arm + self.c_us * (unit * r));
        let turned = so3::skew(&away) * c_sn.to_rotation_matrix().matrix();
        let spread = |m: &Matrix3<f64>, variance: &Vector3<f64>| m * Matrix3::from_diagonal(variance) * m.transpose();
        let covariance = Matrix3::from_diagonal(&self.antenna) + spread(&j, &self.acoustic) + spread(&turned, &self.attitude);
        (away, covariance)
    }
}

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct UsblFix {
    geometry: Geometry,
    delay: f64,
    /// One over the speed of sound \[s/m\].
    slowness: f64,
    longest_range: f64,
    /// How early rows of the transceiver are seen before their stamp, and how much earlier rows of the ship are seen
    /// \[ns\].
    latest: i64,
    gap: i64,
    positions: VecDeque<(Time, Geodetic)>,
    attitudes: VecDeque<(Time, UnitQuaternion<f64>)>,
    /// Time of validity of the latest fix.
    last: Time,
}
memory!(UsblFix { positions, attitudes, last; geometry, delay, slowness, longest_range, latest, gap });

/// The values on both sides of `time`, and the share of the interval before `time`. `None` if they are more than `gap`
/// ns apart or one of them is missing.
fn around<T: Copy>(history: &VecDeque<(Time, T)>, time: Time, gap: i64) -> Option<(T, T, f64)> {
    let after = history.partition_point(|(t, _)| *t < time);
    let (later, b) = *history.get(after)?;
    if later == time {
        return Some((b, b, 0.0));
    }
    let (earlier, a) = *history.get(after.checked_sub(1)?)?;
    let whole = later.seconds_since(earlier);
    (later <= earlier.shifted(gap)).then(|| (a, b, time.seconds_since(earlier) / whole))
}

/// Adds a value and forgets the values that are no longer needed.
fn keep<T>(history: &mut VecDeque<(Time, T)>, time: Time, value: T, oldest: Time) {
    if history.back().is_some_and(|(last, _)| *last >= time) {
        return;
    }
    history.push_back((time, value));
    while history.get(1).is_some_and(|(second, _)| *second < oldest) {
        history.pop_front();
    }
}

impl UsblFix {
    /// The fix that is valid at `time`, if the ship's pose is known then.
    fn fix(&self, time: Time, polar: [f64; 3]) -> Option<[f64; 7]> {
        let (p0, p1, along) = around(&self.positions, time, self.gap)?;
        let (q0, q1, turned) = around(&self.attitudes, time, self.gap)?;
        let antenna = p0.offset(&(p1.difference(&p0) * along));
        let c_sn = q0 * so3::exp(&(so3::log(&(q0.inverse() * q1)) * turned));
        let (away, covariance) = self.geometry.fix(&c_sn, polar);
        let (place, sigma) = (antenna.offset(&away), covariance.diagonal().map(math::sqrt));
        let row = [place.lat, place.lon, place.height, sigma.x, sigma.y, sigma.z, polar[0]];
        row.iter().all(|x| x.is_finite()).then_some(row)
    }
}

impl Stage for UsblFix {
    fn row(&mut self, input: usize, time: Time, row: &[f64], _: Option<&View<'_>>, out: &mut Emitter<'_>) {
        if row.iter().any(|x| !x.is_finite()) {
            return;
        }
        let of_ship = time.shifted(self.latest + self.gap);
        match input {
            TRANSCEIVER if row[0] <= self.longest_range => {
                let valid = time.shifted(self.latest - nanos(self.delay + row[0] * self.slowness));
                if let Some(fix) = self.fix(valid, [row[0], row[1], row[2]]).filter(|_| valid > self.last) {
                    self.last = valid;
                    out.emit(valid, &fix);
                }
            }
            TRANSCEIVER => {}
            SHIP_POSITION => keep(&mut self.positions, of_ship, Geodetic::new(row[0], row[1], row[2]), time),
            _ => keep(&mut self.attitudes, of_ship, Attitude::read(row), time),
        }
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, LONGEST_DELAY, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{Axes, NonNegative, Positive, Vec3Of, dim, range};
    use crate::vocabulary::channel;
    use schemars::JsonSchema;

    /// Computes positions of a transponder from range, bearing and depression, measured by a transceiver under a ship.
    /// Position and attitude of the ship are interpolated at the time of validity.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct UsblFixSpec {
        /// The stream with `range`, `bearing` and `depression`.
        source: String,
        /// The stream with the `position` of the ship's antenna.
        ship_position: String,
        /// The stream with the `attitude` of the ship.
        ship_attitude: String,
        /// The antenna in the axes of the ship.
        antenna: Vec3Of<dim::Length>,
        /// The transceiver in the axes of the ship.
        transceiver: Vec3Of<dim::Length>,
        /// Roll, pitch, yaw of the transceiver's axes in the ship: x_ship = C(mounting) x_transceiver.
        mounting: Option<Vec3Of<dim::Angle>>,
        /// 1σ of the range.
        range_sigma: Positive<dim::Length>,
        /// 1σ of bearing and depression.
        angle_sigma: Axes<dim::Angle, range::Positive, 2>,
        /// 1σ of the antenna's position, north, east, down.
        #[serde(default)]
        position_sigma: Option<Axes<dim::Length, range::NonNegative>>,
        /// 1σ of the ship's attitude about its axes.
        #[serde(default)]
        attitude_sigma: Option<Axes<dim::Angle, range::NonNegative>>,
        /// From the reception of the sound to the stamp of the row.
        #[serde(default)]
        delay: NonNegative<dim::Duration>,
        /// Speed of sound, if stamps are those of reception: a fix is then valid earlier, by the travel time of the sound
        /// over the range. Without it the travel time is zero.
        sound_speed: Option<Positive<dim::Speed>>,
        /// The longest range that is used, if the sound takes time; 1 km by default.
        longest_range: Option<Positive<dim::Length>>,
        /// The longest time between two rows of the ship for interpolation; 1 s by default.
        longest_gap: Option<Positive<dim::Duration>>,
    }

    crate::register!(
        Stage,
        "usbl_fix",
        UsblFixSpec,
        r#"
source = "transceiver"
ship_position = "ship_gps"
ship_attitude = "ship_attitude"
antenna = ["-3 m", "1 m", "-8 m"]
transceiver = ["4 m", "-2 m", "3 m"]
mounting = [0, 0, "45 deg"]
range_sigma = "10 cm"
angle_sigma = "0.5 deg"
position_sigma = "10 cm"
attitude_sigma = ["0.1 deg", "0.1 deg", "0.3 deg"]
delay = "0.4 s"
sound_speed = "1500 m/s"
longest_range = "150 m"
"#
    );

    impl UsblFixSpec {
        fn longest_range(&self) -> f64 {
            self.longest_range.map_or(1000.0, |r| r.si())
        }

        fn longest_gap(&self) -> f64 {
            self.longest_gap.map_or(1.0, |t| t.si())
        }

        /// The longest time from validity to stamp \[s\].
        fn latest(&self) -> f64 {
            self.delay.si() + self.sound_speed.map_or(0.0, |c| self.longest_range() / c.si())
        }
    }

    #[typetag::deserialize(name = "usbl_fix")]
    impl StageSpec for UsblFixSpec {
        fn inputs(&self) -> Vec<Listen> {
            let listen = |source: &str, channels: &[Channel]| Listen {
                source: source.to_owned(),
                channels: channels.to_vec(),
            };
            vec![
                listen(&self.source, &[channel::RANGE, channel::BEARING, channel::DEPRESSION]),
                listen(&self.ship_position, &[channel::POSITION]),
                listen(&self.ship_attitude, &[channel::ATTITUDE]),
            ]
        }

        fn ahead(&self) -> Vec<f64> {
            let ship = self.latest() + self.longest_gap();
            vec![self.latest(), ship, ship]
        }

        fn output(&self) -> Vec<Channel> {
            let sigma = Channel::vector("position_sigma", 3, channel::RANGE.dimension);
            let range = Channel::vector("slant_range", 1, channel::RANGE.dimension);
            vec![channel::POSITION, sigma, range]
        }

        fn build(&self, _: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let (latest, gap) = (self.latest(), self.longest_gap());
            if latest + gap > LONGEST_DELAY {
                let message = format!("rows would be held back for {} s", latest + gap);
                return Err(BuildError::at("delay", message).help("are `delay`, `longest_range` and `sound_speed` right?"));
            }
            let [roll, pitch, yaw] = self.mounting.map_or([0.0; 3], Vec3Of::si);
            let [bearing, depression] = self.angle_sigma.si();
            let squares = |sigma: [f64; 3]| Vector3::from(sigma).map(|s| s * s);
            Ok(Box::new(UsblFix {
                geometry: Geometry {
                    arm: Vector3::from(self.transceiver.si()) - Vector3::from(self.antenna.si()),
                    c_us: so3::from_rpy(roll, pitch, yaw),
                    acoustic: squares([self.range_sigma.si(), bearing, depression]),
                    antenna: squares(self.position_sigma.map_or([0.0; 3], Axes::si)),
                    attitude: squares(self.attitude_sigma.map_or([0.0; 3], Axes::si)),
                },
                delay: self.delay.si(),
                slowness: self.sound_speed.map_or(0.0, |c| 1.0 / c.si()),
                longest_range: if self.sound_speed.is_some() {
                    self.longest_range()
                } else {
                    f64::INFINITY
                },
                latest: nanos(latest),
                gap: nanos(gap),
                positions: VecDeque::new(),
                attitudes: VecDeque::new(),
                last: Time::MIN,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, StageSpec};
    use crate::earth::Gravity;
    use fusion_core::state::LayoutBuilder;

    const SITE: Geodetic = Geodetic::new(0.630_033_801_5, 2.259_327_747_1, 10.0);

    fn stage(also: &str) -> (Box<dyn Stage>, Vec<f64>) {
        let text = format!(
            "source = 'usbl'\nship_position = 'gps'\nship_attitude = 'gyro'\nantenna = [-3, 1, -8]\ntransceiver = [4, -2, 3]\n\
             mounting = [0, 0, '45 deg']\nrange_sigma = 0.1\nangle_sigma = '0.5 deg'\n{also}"
        );
        let spec: UsblFixSpec = toml::from_str(&text).unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "fix",
            layout: &mut layout,
            origin: None,
            gravity: Gravity::default(),
        };
        (spec.build(&mut build).unwrap(), spec.ahead())
    }

    /// The output for rows with these stamps; rows are seen in the same order as in a runner.
    fn fixes(also: &str, rows: &[(usize, f64, Vec<f64>)]) -> Vec<(f64, Vec<f64>)> {
        let (mut stage, ahead) = stage(also);
        let mut seen: Vec<_> = rows
            .iter()
            .map(|(input, stamp, row)| (Time::from_seconds(stamp - ahead[*input]), *input, row))
            .collect();
        seen.sort_by_key(|(time, input, _)| (*time, usize::from(*input == TRANSCEIVER)));
        let mut fixes = Vec::new();
        for (time, input, row) in seen {
            let mut out = Emitter::default();
            stage.row(input, time, row, None, &mut out);
            fixes.extend(out.rows().map(|(valid, fix)| {
                assert!(valid >= time);
                (valid.seconds(), fix.to_vec())
            }));
        }
        fixes
    }

    fn attitude(yaw: f64) -> Vec<f64> {
        let q = so3::from_rpy(2_f64.to_radians(), -1_f64.to_radians(), yaw.to_radians());
        vec![q.w, q.i, q.j, q.k]
    }

    fn at(place: &Geodetic) -> Vec<f64> {
        vec![place.lat, place.lon, place.height]
    }

    fn heard() -> Vec<f64> {
        vec![40.0, 30_f64.to_radians(), 35_f64.to_radians()]
    }

    /// A ship at rest at the site.
    fn resting() -> Vec<(usize, f64, Vec<f64>)> {
        let ship = |t: f64| [(1, t, at(&SITE)), (2, t, attitude(60.0))];
        (0..30).flat_map(|k| ship(0.1 * f64::from(k))).collect()
    }

    #[test]
    fn the_worked_example_of_the_geometry() {
        let rows = [resting(), vec![(0, 1.05, heard())]].concat();
        let all = fixes("", &rows);
        let [(time, fix)] = &all[..] else { panic!("{all:?}") };
        assert!((time - 1.05).abs() < 1e-9);
        // Computed by hand elsewhere: 1e-5 m; a degree of latitude has 1.1e5 m, so 5e-10 deg of rounding.
        let off = Geodetic::new(fix[0], fix[1], fix[2]).difference(&SITE);
        assert!((off - Vector3::new(-16.335_96, 26.600_41, 35.187_09)).norm() < 2e-4, "{off}");
        assert!((fix[0].to_degrees() - 36.098_130_555).abs() < 2e-9 && (fix[1].to_degrees() - 129.450_239_834).abs() < 2e-9);
        assert_eq!(fix[6], 40.0);
    }

    #[test]
    fn the_covariance_is_that_of_many_draws() {
        use fusion_core::testing::Lcg;
        let geometry = Geometry {
            arm: Vector3::new(7.0, -3.0, 11.0),
            c_us: so3::from_rpy(0.0, 0.0, 0.8),
            acoustic: Vector3::new(0.01, 7.6e-5, 7.6e-5),
            antenna: Vector3::repeat(0.01),
            attitude: Vector3::new(2.7e-5, 1.2e-5, 7.6e-5),
        };
        let (c_sn, polar) = (so3::from_rpy(0.03, -0.02, 1.0), [40.0, 0.5, 0.6]);
        let (away, covariance) = geometry.fix(&c_sn, polar);
        let (mut random, mut sum, n) = (Lcg::new(3), Matrix3::zeros(), 20_000);
        let mut normal = |variance: f64| variance.sqrt() * random.normal();
        for _ in 0..n {
            let turn = geometry.attitude.map(&mut normal);
            let by = geometry.acoustic.map(&mut normal);
            let (drawn, _) = geometry.fix(&(c_sn * so3::exp(&turn)), [polar[0] + by.x, polar[1] + by.y, polar[2] + by.z]);
            let e = drawn - away + geometry.antenna.map(&mut normal);
            sum += e * e.transpose() / f64::from(n);
        }
        // 4 %: √(2/n) = 1 % of a variance, and 1 % of second order at 40 m.
        for i in 0..3 {
            assert!((sum[(i, i)] / covariance[(i, i)] - 1.0).abs() < 0.04, "{sum} {covariance}");
        }
        assert!((sum - covariance).norm() < 0.04 * covariance.norm());
    }

    #[test]
    fn the_ship_is_taken_where_it_was_when_the_sound_was_heard() {
        // 2 m/s north, 6 deg/s: 1.3 s between reply and stamp are 2.6 m and 8 deg.
        let mut rows = Vec::new();
        for k in 0..60_i32 {
            let t = 0.1 * f64::from(k);
            rows.push((1, t, at(&SITE.offset(&Vector3::new(2.0 * t, 0.0, 0.0)))));
            rows.push((2, t + 0.03, attitude(60.0 + 6.0 * (t + 0.03))));
        }
        rows.push((0, 3.0, heard()));
        let way = 40.0 / 1500.0;
        let all = fixes("delay = 1.3\nsound_speed = 1500\nlongest_range = 90", &rows);
        let [(time, fix)] = &all[..] else { panic!("{all:?}") };
        let valid = 3.0 - 1.3 - way;
        assert!((time - valid).abs() < 2e-9, "{time}");
        let still = [
            (0..60)
                .flat_map(|k| {
                    let t = 0.1 * f64::from(k);
                    [
                        (1, t, at(&SITE.offset(&Vector3::new(2.0 * valid, 0.0, 0.0)))),
                        (2, t, attitude(60.0 + 6.0 * valid)),
                    ]
                })
                .collect::<Vec<_>>(),
            vec![(0, valid, heard())],
        ]
        .concat();
        let wanted = &fixes("", &still)[0].1;
        // 1e-3 m: roll and pitch are 2 deg, so the way between two attitudes is not a pure turn about down.
        let off = Geodetic::new(fix[0], fix[1], fix[2]).difference(&Geodetic::new(wanted[0], wanted[1], wanted[2]));
        assert!(off.norm() < 1e-3, "{off}");
    }

    #[test]
    fn without_the_ship_there_is_no_fix() {
        let silent = |from: f64, to: f64| {
            resting()
                .into_iter()
                .filter(move |(_, t, _)| !(from..to).contains(t))
                .collect::<Vec<_>>()
        };
        let heard = vec![(0, 1.55, heard())];
        assert_eq!(fixes("longest_gap = 0.5", &[silent(1.15, 1.55), heard.clone()].concat()).len(), 1);
        assert_eq!(fixes("longest_gap = 0.5", &[silent(1.15, 1.95), heard.clone()].concat()).len(), 0);
        assert_eq!(fixes("", &[silent(1.55, 9.0), heard].concat()).len(), 0, "nothing is extrapolated");
    }

    #[test]
    fn ranges_beyond_the_longest_are_not_taken() {
        let also = "sound_speed = 1500\nlongest_range = 39";
        assert!(fixes(also, &[resting(), vec![(0, 1.5, heard())]].concat()).is_empty());
    }
}
