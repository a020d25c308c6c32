//! The filter of fusion-nav in an emulator: the rows of `rows.bin`, and what they cost. `microcontroller.py` builds it.
//!
//! The streams are those of `configs/ins-gps.toml`: the rates and specific forces of the inertial unit, the place of the
//! antenna, its velocity. The filter is as shipped, and starts as its documentation says, from a window at rest.

#![no_std]
#![no_main]

mod board;
mod rows;
mod stack;

use board::Counter;
use core::mem::size_of_val;
use fusion_nav::prelude::*;
use rows::{Cost, Source};
use semihosting::{println, process};
use stack::Painted;

/// The streams, in the order of their numbers, and the count of numbers in a row.
const STREAMS: [(&str, usize); 4] = [("imu", 6), ("position", 3), ("velocity", 3), ("reference", 10)];
/// Forward, right, down [m].
const ANTENNA: [f32; 3] = [0.3, 0.0, -1.0];
/// Nanoseconds between two samples, and the time [µs] at which all stamps are positive.
const INTERVAL: f32 = 0.01;
const LATER: i64 = 1_000_000;

fn begin() -> ! {
    process::exit(match replay() {
        Ok(()) => 0,
        Err(what) => {
            println!("{what}");
            1
        }
    })
}

/// Three numbers of a row.
fn three(row: &[f64]) -> [f32; 3] {
    [row[0] as f32, row[1] as f32, row[2] as f32]
}

fn replay() -> Result<(), &'static str> {
    let counter = Counter::start().ok_or("the clock is in use")?;
    // Above the stack that is measured; the size of the filter is added to it.
    let mut source = Source::open()?;
    let mut row = [0.0; 64];
    let mut filter = Eskf::default();
    let mut window = StaticWindow::new();
    let mut costs = [Cost::default(); STREAMS.len()];
    let mut refused = 0;
    let mut fix = None;
    let [x, y, z] = ANTENNA;
    let antenna = Position::body(x, y, z);

    let painted = Painted::new();
    source.each_row(&STREAMS.map(|(_, width)| width), &mut row, |stream, time, row| {
        let time = Timestamp::from_micros((time / 1000 + LATER) as u64);
        let is_running = filter.is_initialized();
        if stream == 0 {
            let ([p, q, r], [x, y, z]) = (three(&row[0..3]), three(&row[3..6]));
            let interval = Seconds::from_secs(INTERVAL);
            let imu = ImuSample::from_rates(time, AngularRate::body(p, q, r), Acceleration::body(x, y, z), interval);
            if !is_running {
                let at_rest = StaticSample {
                    imu,
                    ..StaticSample::default()
                };
                window.push(at_rest).map_err(|_| "a sample at rest was refused")?;
                if window.is_long_enough(filter.config()) {
                    let alignment = filter.initialize(&window).map_err(|_| "the filter does not start")?;
                    if !alignment.is_static() {
                        return Err("the window was not at rest");
                    }
                    // The declared heading of the start: without one the filter aligns.
                    let heading = Radians::from_degrees(30.0);
                    filter.fuse_gnss_heading(time, heading, HeadingNoise::from_sigma(0.02));
                }
                return Ok(());
            }
            let before = counter.now();
            let done = filter.predict(imu);
            costs[stream].add(counter.since(before));
            refused += u32::from(!done.is_propagated());
            return Ok(());
        }
        if !is_running {
            return Ok(());
        }
        if stream == 1 {
            let place = Geodetic::from_radians(row[0], row[1], row[2]);
            let noise = PositionNoise::from_sigma(1.0, 1.0, 2.0);
            let before = counter.now();
            let done = filter.fuse_gnss_geodetic(time, place, noise, antenna);
            costs[stream].add(counter.since(before));
            refused += u32::from(!done.is_accepted());
            fix = Some(place);
        } else if stream == 2 {
            let [north, east, down] = three(row);
            let noise = VelocityNoise::from_sigma(0.05, 0.05, 0.05);
            let before = counter.now();
            let done = filter.fuse_gnss_velocity(time, Velocity::ned(north, east, down), noise, antenna);
            costs[stream].add(counter.since(before));
            refused += u32::from(!done.is_accepted());
        }
        Ok(())
    })?;
    let stack = painted.used();

    // That it has followed the vehicle: the last fix minus the estimate [mm], and what it did not use.
    let origin = filter.origin().ok_or("the filter has no origin")?;
    let (fixed, estimate) = (origin.to_ned(fix.ok_or("no fix")?), filter.state().position);
    let off = |a: f32, b: f32| ((a - b) * 1000.0) as i32;
    println!("off {} {}", off(fixed.x(), estimate.x()), off(fixed.y(), estimate.y()));
    println!("refused {refused}");
    println!("filter {}", size_of_val(&filter));
    println!("stack {stack}");
    for (cost, (name, _)) in costs.iter().zip(STREAMS) {
        cost.print(name);
    }
    Ok(())
}
