//! A filter in a vehicle: three threads deliver rows when they are there, one estimates.
//!
//! An inertial unit at 100 Hz, a receiver whose fixes come 0.2 s late, and an acoustic fix that comes about
//! 2 s after the ping that it was valid at, with jitter. The design says `order = "rewind"`: the filter uses
//! every row as soon as it arrives, at its time of validity. Ten times a second the program prints the estimate
//! of *now* with its 1σ; it does not wait for late rows.
//!
//! `cargo run --release --example live -- 100` runs a hundred times faster than real time.
#![expect(clippy::print_stdout, reason = "an example prints")]

use fusion::core::testing::Lcg;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{Builder, sleep};
use std::time::{Duration, Instant};

/// A row on its way: stream, when it was valid \[s\], its numbers.
type Fix = (&'static str, f64, Vec<f64>);

/// Makes the numbers of a row.
type Numbers = fn(&mut Lcg) -> Vec<f64>;

/// How long the vehicle drives \[s\].
const DRIVE: f64 = 30.0;
const ORIGIN: [f64; 3] = [0.63, 2.26, 0.0];

/// Where the vehicle is: it stays at the origin.
fn place(random: &mut Lcg, sigma: f64) -> Vec<f64> {
    let metre = 1.0 / 6.37e6;
    let [lat, lon, height] = ORIGIN;
    let mut error = || sigma * 1.7 * random.signed();
    vec![lat + error() * metre, lon + error() * metre, height + error()]
}

/// Delivers a row every `period` seconds, each `late` seconds after it was valid, and up to `jitter` more.
fn deliver(to: Sender<Fix>, clock: Clock, stream: &'static str, [period, late, jitter]: [f64; 3], row: Numbers) {
    let mut random = Lcg::new(stream.len() as u64);
    for k in 0..(DRIVE / period) as u32 {
        let valid = f64::from(k) * period;
        clock.wait_for(valid + late + jitter * random.unit());
        // The receiver is closed: the drive is over.
        if to.send((stream, valid, row(&mut random))).is_err() {
            return;
        }
    }
}

/// Time that passes faster.
#[derive(Clone, Copy)]
struct Clock(Instant, f64);

impl Clock {
    fn now(self) -> f64 {
        self.0.elapsed().as_secs_f64() * self.1
    }

    fn wait_for(self, time: f64) {
        sleep(Duration::from_secs_f64(((time - self.now()) / self.1).max(0.0)));
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let faster: f64 = std::env::args().nth(1).map_or(Ok(1.0), |times| times.parse())?;
    let mut nav = fusion::Navigator::from_toml(include_str!("live.toml"))?;
    let clock = Clock(Instant::now(), faster);
    let (to, rows) = channel();
    let still: Numbers = |random| {
        let mut shake = |size: f64| size * random.signed();
        vec![shake(1e-3), shake(1e-3), shake(1e-3), shake(0.02), shake(0.02), shake(0.02) - 9.8]
    };
    let threads: [(&'static str, [f64; 3], Numbers); 3] = [
        ("imu", [0.01, 0.0, 0.0], still),
        ("gnss", [1.0, 0.2, 0.0], |random| place(random, 2.0)),
        ("usbl", [2.0, 1.8, 0.4], |random| place(random, 0.5)),
    ];
    for (stream, timing, row) in threads {
        let to = to.clone();
        Builder::new()
            .name(stream.to_owned())
            .spawn(move || deliver(to, clock, stream, timing, row))?;
    }
    drop(to);
    estimate(&mut nav, &rows, clock)
}

/// Uses rows as they arrive, and prints the present estimate ten times a second.
fn estimate(nav: &mut fusion::Navigator, rows: &Receiver<Fix>, clock: Clock) -> Result<(), Box<dyn std::error::Error>> {
    let (mut due, mut newest) = (0.0, 0.0_f64);
    for (stream, valid, row) in rows {
        nav.feed(stream, valid, &row)?;
        newest = newest.max(valid);
        if newest < due {
            continue;
        }
        due = newest + 0.1;
        let now = clock.now().max(newest);
        if let Some(solution) = nav.predict(now)
            && let Some((place, covariance)) = solution.position
        {
            let north = (place.lat - ORIGIN[0]) * 6.37e6;
            println!("{now:7.2} s  {north:6.2} m north, 1σ {:5.2} m", covariance[(0, 0)].sqrt());
        }
    }
    let rewinds = nav.assembly().runner.rewinds().ok_or("the design holds rows back")?;
    println!("went back {} times, at most {} rows at once", rewinds.count, rewinds.most);
    Ok(())
}
