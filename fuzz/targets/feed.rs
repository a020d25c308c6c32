//! Rows with any stamps and numbers, fed to a filter: it survives, and its solution is a number.

#![no_main]

use fusion::Navigator;
use fusion::assembly::{assemble, declared_streams};
use fusion::config::Document;
use fusion::core::time::Time;
use fusion::design::Design;
use fusion::examine::build;
use libfuzzer_sys::fuzz_target;

/// An inertial unit with estimated biases, a receiver of position and velocity with gates and a
/// reported 1σ, a barometer without a gate.
const DESIGN: &str = include_str!("feed.toml");

thread_local! {
    /// Read once: most of the time of a short sequence.
    static DECLARED: Design = {
        let (document, _) = Document::parse("feed.toml", DESIGN);
        build(document).unwrap_or_else(|d| panic!("{d}"))
    };
}

/// The rest of the input.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn float(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }
}

/// The row of a vehicle at rest.
fn at_rest(channel: &str, width: usize) -> Vec<f64> {
    match channel {
        "position" => vec![0.8, 0.1, 400.0],
        "specific_force" => vec![0.0, 0.0, -9.81],
        "height" => vec![400.0],
        name if name.ends_with("_sigma") => vec![1.0; width],
        _ => vec![0.0; width],
    }
}

/// The stamp of the next row \[s\]; `last` is the stamp of the row before.
fn stamp(kind: u8, last: f64, bytes: &mut Bytes<'_>) -> Option<f64> {
    Some(match (kind >> 2) & 3 {
        0 => last + 0.01,
        1 => last + 0.01 * f64::from(i16::from_le_bytes(bytes.take()?)),
        2 => last,
        _ => bytes.float()?,
    })
}

/// Changes the numbers of a row at rest.
fn disturb(kind: u8, row: &mut [f64], bytes: &mut Bytes<'_>) -> Option<()> {
    match (kind >> 4) & 3 {
        0 => {}
        1 => {
            for value in row.iter_mut() {
                *value *= 1.0 + f64::from(bytes.byte()?.cast_signed()) / 1024.0;
                *value += f64::from(bytes.byte()?.cast_signed()) / 1024.0;
            }
        }
        2 => {
            let at = usize::from(bytes.byte()?) % row.len();
            row[at] = bytes.float()?;
        }
        _ => {
            for value in row.iter_mut() {
                *value = bytes.float()?;
            }
        }
    }
    Some(())
}

fn check(nav: &mut Navigator) {
    let Some(belief) = nav.belief() else { return };
    assert!(belief.x.iter().all(|x| x.is_finite()), "state {:?}", belief.x);
    for block in nav.layout().blocks() {
        for sigma in belief.covariance.sigmas(block) {
            assert!(sigma.is_finite() && sigma >= 0.0, "σ of {}: {sigma}", block.name);
        }
    }
    let solution = nav.solution().expect("there is a belief");
    let (place, spread) = solution.position.expect("the design has a position");
    let numbers = [place.lat, place.lon, place.height].into_iter().chain(spread.iter().copied());
    assert!(numbers.into_iter().all(f64::is_finite), "{place:?} {spread}");
}

fn feed(mut bytes: Bytes<'_>) -> Option<()> {
    let mut nav = DECLARED.with(|design| {
        let assembled = declared_streams(design).and_then(|streams| assemble(design, streams));
        Navigator::from_assembly(assembled.unwrap_or_else(|d| panic!("{d}")))
    });
    let streams = nav.streams().to_vec();
    let mut last = 0.0;
    while let Some(kind) = bytes.byte() {
        let stream = &streams[usize::from(kind & 3) % streams.len()];
        let seconds = stamp(kind, last, &mut bytes)?;
        let rest = stream.channels.iter().map(|c| at_rest(&c.name, c.width));
        let mut row = rest.collect::<Vec<_>>().concat();
        disturb(kind, &mut row, &mut bytes)?;
        let is_time = Time::checked_from_seconds(seconds).is_some();
        let fed = nav.feed(&stream.name, seconds, &row);
        assert!(is_time || fed.is_err(), "{seconds} s was taken for a time");
        if fed.is_ok() {
            last = seconds;
        }
        check(&mut nav);
    }
    // Process the rows that are held back.
    nav.finish(&mut |_: &fusion::core::runner::Event<'_>| {})
        .expect("no observer fails");
    check(&mut nav);
    Some(())
}

fuzz_target!(|bytes: &[u8]| {
    fusion::models::link();
    feed(Bytes(bytes));
});
