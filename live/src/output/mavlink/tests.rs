//! Frames by their bytes, as MAVLink defines them and as `pymavlink` 2.4.50 packs them: `by_pymavlink.py` prints these.

use super::*;
use fusion::core::geometry::wgs84::Geodetic;
use fusion::core::time::Time;
use fusion::output::EstimateClock;
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion};

/// Keeps what is sent.
#[derive(Default)]
struct Kept(Vec<u8>);

impl Sender for Kept {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.extend(bytes);
        Ok(())
    }
}

const DESIGN: &str = "link = \"autopilot\"\nsystem_id = 42\n";

fn output(message: &str) -> Box<dyn Output> {
    let spec: MavlinkSpec = toml::from_str(&format!("{DESIGN}message = {message}")).unwrap();
    let about = About {
        description: String::new(),
        origin: Origin::new(None),
        clock: EstimateClock::default(),
        sensors: Vec::new(),
    };
    spec.open(&about).unwrap()
}

/// Week 2374, 259 200.25 s: 2025-07-09 with 18 leap seconds.
const GPS: i64 = (2374 * 604_800 + 259_200) * 1_000_000_000 + 250_000_000;

fn estimate(solution: Option<Solution>, health: State) -> Outgoing {
    Outgoing {
        number: 0,
        solution,
        time: Time::from_seconds(12.5),
        gps_nanos: Some(GPS),
        age: None,
        health,
        reasons: [].into(),
        waits_for: [].into(),
        sensors: [].into(),
    }
}

const PLACE: Geodetic = Geodetic {
    lat: 0.8,
    lon: -0.25,
    height: 431.5,
};

/// Any positive definite covariance of position, velocity and attitude.
fn covariance() -> SMatrix<f64, 9, 9> {
    let root = SMatrix::<f64, 9, 9>::from_fn(|i, j| f64::from(u8::from(i == j)) + 0.1 * ((3 * i + 5 * j) as f64).sin());
    root * root.transpose()
}

fn part(i: usize, j: usize) -> Matrix3<f64> {
    covariance().fixed_view::<3, 3>(3 * i, 3 * j).into_owned()
}

fn attitude() -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.3, -0.5, 2.0)
}

const VELOCITY: [f64; 3] = [4.0, -3.0, 1.25];

fn solution() -> Solution {
    Solution {
        time: Time::from_seconds(12.5),
        position: Some((PLACE, part(0, 0))),
        velocity: Some((VELOCITY.into(), part(1, 1))),
        attitude: Some((attitude(), part(2, 2))),
        with_attitude: [part(0, 2), part(1, 2)],
    }
}

fn sent(output: &mut dyn Output, estimate: &Outgoing) -> Vec<u8> {
    let mut kept = Kept::default();
    output.send(estimate, Some(&mut kept)).unwrap();
    kept.0
}

/// Fields of a content in the order of a frame.
struct Content(Vec<u8>);

impl Content {
    /// The content of the only frame, with the number, the length and the `CRC_EXTRA` that MAVLink gives its message.
    fn of(frame: &[u8], id: u32, length: usize, extra: u8) -> Self {
        let end = frame.len() - 2;
        assert_eq!(frame[0], 0xfd);
        assert_eq!(usize::from(frame[1]), end - 10, "more than one frame");
        assert_eq!((frame[2..4].to_vec(), &frame[5..7]), (vec![0, 0], &[42, 197][..]));
        assert_eq!(frame[7..10], id.to_le_bytes()[..3]);
        // CRC-16/MCRF4XX with the polynomial 0x1021, whose bits are reversed.
        let sum = frame[1..end].iter().chain(&[extra]).fold(0xffff_u16, |sum, byte| {
            let mixed = (sum.reverse_bits() >> 8) as u8 ^ byte.reverse_bits();
            let shifted = (0..8).fold(u16::from(mixed) << 8, |r, _| r << 1 ^ if r >> 15 == 1 { 0x1021 } else { 0 });
            (sum.reverse_bits() << 8 ^ shifted).reverse_bits()
        });
        assert_eq!(frame[end..], sum.to_le_bytes());
        let mut content = frame[10..end].to_vec();
        assert!(content.len() <= length);
        content.resize(length, 0);
        Self(content)
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let rest = self.0.split_off(N);
        core::mem::replace(&mut self.0, rest).try_into().unwrap()
    }

    fn real(&mut self) -> f64 {
        f32::from_le_bytes(self.take()).into()
    }

    fn reals<const N: usize>(&mut self) -> [f64; N] {
        core::array::from_fn(|_| self.real())
    }
}

/// Whether two numbers agree to the digits of `f32`, or both are NaN.
fn is_near(found: f64, wanted: f64) -> bool {
    (found.is_nan() && wanted.is_nan()) || (found - wanted).abs() <= 2.0 * f64::from(f32::EPSILON) * wanted.abs()
}

/// The covariance of a function of the errors of position, velocity and attitude, by central differences.
fn by_differences(of: impl Fn(SVector<f64, 9>) -> SVector<f64, 6>) -> Matrix6<f64> {
    let step = 1e-5;
    let column = |k| {
        let e = SVector::<f64, 9>::ith(k, step);
        (of(e) - of(-e)) / (2.0 * step)
    };
    let jacobian = SMatrix::<f64, 6, 9>::from_columns(&core::array::from_fn::<_, 9, _>(column));
    jacobian * covariance() * jacobian.transpose()
}

fn turned(e: &SVector<f64, 9>) -> UnitQuaternion<f64> {
    attitude() * UnitQuaternion::from_scaled_axis(Vector3::new(e[6], e[7], e[8]))
}

/// 1e-7: central differences with a step of 1e-5 err by 1e-10 of each element, and `f32` by 6e-8.
fn assert_upper(found: &[f64; 21], wanted: &Matrix6<f64>) {
    let mut found = found.iter();
    for i in 0..6 {
        for j in i..6 {
            let (found, wanted) = (*found.next().unwrap(), wanted[(i, j)]);
            let is_near = (found - wanted).abs() < 2e-7 * (1.0 + wanted.abs());
            assert!(is_near || (found.is_nan() && wanted.is_nan()), "{i} {j}: {found} is not {wanted}");
        }
    }
}

fn pose(e: SVector<f64, 9>) -> SVector<f64, 6> {
    let (roll, pitch, yaw) = turned(&e).euler_angles();
    SVector::from([e[0], e[1], e[2], roll, pitch, yaw])
}

/// Unix time of [`GPS`] \[µs\]: ten years and two leap days lie between 1970 and 1980, and five days to Sunday.
const UNIX: u64 = ((3657 * 86_400 + 2374 * 604_800 + 259_200 - 18) * 1000 + 250) * 1000;

#[test]
fn odometry_has_a_pose_in_local_axes_and_a_velocity_in_body_axes() {
    let mut output = output("\"odometry\"");
    sent(output.as_mut(), &estimate(None, State::Aligning));
    // The first place is the origin; the second one is 1e-5 rad north of it and 2 m higher.
    sent(output.as_mut(), &estimate(Some(solution()), State::Good));
    let mut moved = solution();
    let place = Geodetic {
        lat: PLACE.lat + 1e-5,
        height: PLACE.height + 2.0,
        ..PLACE
    };
    moved.position = Some((place, part(0, 0)));
    let frame = sent(output.as_mut(), &estimate(Some(moved), State::Degraded));
    let mut content = Content::of(&frame, 331, 233, 91);
    assert_eq!(u64::from_le_bytes(content.take()), UNIX);
    let [x, y, z] = content.reals();
    // The radius of the meridian at 45.84° is 6 368 319 m (Groves 2013, 2.105), and the place is 432 m above the ellipsoid.
    assert!(
        (x - 63.6875).abs() < 1e-3 && y.abs() < 1e-3 && (z + 2.0).abs() < 1e-3,
        "{x} {y} {z}"
    );
    let q = attitude();
    for (found, wanted) in content.reals::<4>().into_iter().zip([q.w, q.i, q.j, q.k]) {
        assert!(is_near(found, wanted), "{found} is not {wanted}");
    }
    let body = q.inverse() * Vector3::from(VELOCITY);
    for (found, wanted) in content.reals::<3>().into_iter().zip(body.iter()) {
        assert!(is_near(found, *wanted), "{found} is not {wanted}");
    }
    assert!(content.reals::<3>().into_iter().all(f64::is_nan));
    assert_upper(&content.reals(), &by_differences(pose));
    let velocity = by_differences(|e| {
        let v = turned(&e).inverse() * (Vector3::from(VELOCITY) + Vector3::new(e[3], e[4], e[5]));
        SVector::from([v.x, v.y, v.z, 0.0, 0.0, 0.0])
    });
    let mut known = Matrix6::repeat(f64::NAN);
    known.fixed_view_mut::<3, 3>(0, 0).copy_from(&velocity.fixed_view::<3, 3>(0, 0));
    assert_upper(&content.reals(), &known);
    // Frames, the count of starts, the type of the estimator and the quality.
    assert_eq!(content.take(), [1, 12, 1, 0, 25]);
}

#[test]
fn a_pose_has_angles_and_is_not_sent_without_them() {
    let mut output = output("[\"vision_position_estimate\"]");
    let frame = sent(output.as_mut(), &estimate(Some(solution()), State::Lost));
    let mut content = Content::of(&frame, 102, 117, 158);
    assert_eq!(u64::from_le_bytes(content.take()), UNIX);
    for (found, wanted) in content.reals::<6>().into_iter().zip([0.0, 0.0, 0.0, 0.3, -0.5, 2.0]) {
        // 1e-7: a quaternion of 53 bits keeps the angles, `f32` has 24.
        assert!((found - wanted).abs() < 1.2e-7, "{found} is not {wanted}");
    }
    assert_upper(&content.reals(), &by_differences(pose));
    assert_eq!(content.take(), [0]);
    let again = sent(output.as_mut(), &estimate(Some(solution()), State::Good));
    assert_eq!(again[4], 1, "frames are counted");
    assert_eq!(Content::of(&again, 102, 117, 158).0[116], 1, "the estimate may have jumped");
    let level = Solution {
        attitude: None,
        ..solution()
    };
    assert!(sent(output.as_mut(), &estimate(Some(level), State::Good)).is_empty());
    // Beyond the range of `f32`, a covariance is unknown.
    let wide = Solution {
        position: Some((PLACE, Matrix3::repeat(1e39))),
        ..solution()
    };
    let frame = sent(output.as_mut(), &estimate(Some(wide), State::Good));
    let mut content = Content::of(&frame, 102, 117, 158);
    content.take::<32>();
    assert!(content.real().is_nan());
}

#[test]
fn a_fix_has_the_accuracy_of_the_estimate_and_the_time_of_the_week() {
    let mut output = output("\"gps_input\"");
    let frame = sent(output.as_mut(), &estimate(Some(solution()), State::Good));
    let mut content = Content::of(&frame, 232, 65, 151);
    assert_eq!(u64::from_le_bytes(content.take()), UNIX);
    assert_eq!(u32::from_le_bytes(content.take()), 259_200_250);
    let degrees = |radians: f64| (radians.to_degrees() * 1e7).round() as i32;
    assert_eq!(i32::from_le_bytes(content.take()), degrees(PLACE.lat));
    assert_eq!(i32::from_le_bytes(content.take()), degrees(PLACE.lon));
    let largest = |p: Matrix3<f64>, axes: usize| (0..axes).map(|k| p[(k, k)].sqrt()).fold(0.0, f64::max);
    let [north, east, down] = VELOCITY;
    let expected = [
        PLACE.height,
        65_535.0,
        65_535.0,
        north,
        east,
        down,
        largest(part(1, 1), 3),
        largest(part(0, 0), 2),
        part(0, 0)[(2, 2)].sqrt(),
    ];
    for (found, wanted) in content.reals::<9>().into_iter().zip(expected) {
        assert!(is_near(found, wanted), "{found} is not {wanted}");
    }
    // Flags: no dilution of precision. Then the week, the number of the receiver, the fix, the satellites, the heading.
    assert_eq!(content.take::<2>(), [6, 0]);
    assert_eq!(u16::from_le_bytes(content.take()), 2374);
    assert_eq!(content.take::<3>(), [0, 3, 255]);
    assert_eq!(u16::from_le_bytes(content.take()), (2.0_f64.to_degrees() * 100.0).round() as u16);

    let still = Solution {
        velocity: None,
        ..solution()
    };
    let frame = sent(output.as_mut(), &estimate(Some(still), State::Aligning));
    let content = Content::of(&frame, 232, 65, 151);
    assert_eq!((content.0[56], &content.0[63..65]), (6 | 8 | 16 | 32, &[0, 0][..]));
    for none in [estimate(None, State::Aligning), estimate(Some(solution()), State::Lost)] {
        let content = Content::of(&sent(output.as_mut(), &none), 232, 65, 151);
        assert_eq!((content.0[56], content.0[61]), (255, 0));
    }
}

#[test]
fn a_place_has_the_time_since_the_start_and_a_heading() {
    let mut output = output("[\"odometry\", \"global_position_int\"]");
    let level = Solution {
        attitude: None,
        ..solution()
    };
    let frame = sent(output.as_mut(), &estimate(Some(level), State::Good));
    let mut content = Content::of(&frame, 33, 28, 104);
    assert_eq!(u32::from_le_bytes(content.take()), 12_500);
    let whole: [i32; 4] = core::array::from_fn(|_| i32::from_le_bytes(content.take()));
    let degrees = |radians: f64| (radians.to_degrees() * 1e7).round() as i32;
    assert_eq!(whole, [degrees(PLACE.lat), degrees(PLACE.lon), 431_500, 0]);
    let speeds: [i16; 3] = core::array::from_fn(|_| i16::from_le_bytes(content.take()));
    assert_eq!((speeds, u16::from_le_bytes(content.take())), ([400, -300, 125], u16::MAX));
    assert!(sent(output.as_mut(), &estimate(None, State::Good)).is_empty());
    // Both messages: the first one has the number 331.
    let both = sent(output.as_mut(), &estimate(Some(solution()), State::Good));
    let second = 12 + usize::from(both[1]);
    assert_eq!((&both[7..9], both[second], both[second + 7]), (&[0x4b, 1][..], 0xfd, 33));
    let content = Content::of(&both[second..], 33, 28, 104);
    assert_eq!(content.0[26..28], 11_459_u16.to_le_bytes());
}

#[test]
fn what_cannot_be_sent_is_an_error() {
    let mut output = output("\"gps_input\"");
    let error = output.send(&estimate(None, State::Good), None).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::NotConnected);
    let spec = |text: &str| toml::from_str::<MavlinkSpec>(text);
    assert!(spec("link = \"a\"\nmessage = \"attitude\"").is_err());
    let about = About {
        description: String::new(),
        origin: Origin::new(None),
        clock: EstimateClock::default(),
        sensors: Vec::new(),
    };
    let none = spec("link = \"a\"\nmessage = []").unwrap().open(&about).err().unwrap();
    assert_eq!(none.to_string(), "an output of the type `mavlink` has a `message`");
}

/// Level, to the north, with numbers that `f32` holds exactly.
fn plain() -> Solution {
    let exact = SMatrix::<f64, 9, 9>::from_fn(|i, j| {
        let (small, large) = (i.min(j) as f64, i.max(j) as f64);
        f64::from(u8::from(i == j)) * 64.0 + small + large / 16.0
    });
    let part = |i: usize, j: usize| exact.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
    Solution {
        time: Time::from_seconds(12.5),
        position: Some((PLACE, part(0, 0))),
        velocity: Some((VELOCITY.into(), part(1, 1))),
        attitude: Some((UnitQuaternion::identity(), part(2, 2))),
        with_attitude: [part(0, 2), part(1, 2)],
    }
}

/// `by_pymavlink.py` prints these frames.
const OF_PYMAVLINK: [&str; 4] = [
    "fde90000002ac54b01001068ffc0733906000000000000000000000000000000803f00000000000000000000000000008040000040c000\
     00a03f0000c07f0000c07f0000c07f000080420000803d0000003e0000c03e0000e03e0000003f002082420000903f0000b03f0000b83f\
     0000c03f004084420000184000001c400000204000c08c420000ce400000d04000e08e420000f04000009142c07d564440df5344007c03\
     c40000c07f0000c07f0000c07fc0049c440000ec420000c07f0000c07f0000c07f00bf01450000c07f0000c07f0000c07f0000c07f0000\
     c07f0000c07f0000c07f0000c07f0000c07f010c000064718c",
    "fd740000012ac56600001068ffc073390600000000000000000000000000000000000000008000000000000080420000803d0000003e00\
     00c03e0000e03e0000003f002082420000903f0000b03f0000b83f0000c03f004084420000184000001c400000204000c08c420000ce40\
     0000d04000e08e420000f0400000914240ae",
    "fd410000022ac5e800001068ffc073390600fa14730f1c1d521be75676f700c0d74300ff7f4700ff7f4700008040000040c00000a03fe4\
     340541e10e01418f1b0241060046090003ffa08c877b",
    "fd190000032ac5210000d43000001c1d521be75676f78c950600000000009001d4fe7d5914",
];

#[test]
fn every_message_matches_pymavlink() {
    let mut output = output("[\"odometry\", \"vision_position_estimate\", \"gps_input\", \"global_position_int\"]");
    let mut bytes = &sent(output.as_mut(), &estimate(Some(plain()), State::Good))[..];
    for expected in OF_PYMAVLINK {
        let (frame, rest) = bytes.split_at(12 + usize::from(bytes[1]));
        let hex: String = frame.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, expected);
        bytes = rest;
    }
    assert!(bytes.is_empty());
}
