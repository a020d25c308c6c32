//! Replays rows in an emulator, and prints what they cost. The estimates have the bits of the host.
//!
//! It reads `rows.bin`, which `fusion compile --rows` writes, over semihosting. A program on a vehicle reads its sensors
//! in place of it: see the chapter *On a microcontroller* of the book.

#![no_std]
#![no_main]

mod board;
mod stack;

use board::Counter;
use core::mem::MaybeUninit;
use filter::{STREAMS, assemble};
use fusion_abi::Arena;
use fusion_abi::fusion_vehicle::Digest;
use fusion_abi::fusion_vehicle::fusion_core::Time;
use fusion_abi::fusion_vehicle::fusion_core::runner::Event;
use semihosting::fs::File;
use semihosting::io::Read;
use semihosting::{println, process};
use stack::Painted;

#[global_allocator]
static ARENA: Arena = Arena::new();

/// Room for the largest design; it prints how much of it was used.
const ROOM: usize = 1 << 20;
static mut MEMORY: MaybeUninit<[u8; ROOM]> = MaybeUninit::uninit();

/// The instructions of the rows of one stream.
#[derive(Clone, Copy, Default)]
struct Cost {
    rows: u64,
    all: u64,
    most: u32,
}

fn begin() -> ! {
    process::exit(match replay() {
        Ok(()) => 0,
        Err(what) => {
            println!("{what}");
            1
        }
    })
}

fn replay() -> Result<(), &'static str> {
    // SAFETY: nothing else uses this block.
    unsafe { ARENA.place((&raw mut MEMORY).cast(), ROOM) }
    let counter = Counter::start().ok_or("the clock is in use")?;

    // Above the stack that is measured.
    let mut source = Source::open()?;
    let mut row = [0.0; 64];

    let painted = Painted::new();
    let mut vehicle = assemble();
    let (assembled, assembling) = (ARENA.most_used(), painted.used());
    let painted = Painted::new();
    let mut costs = [Cost::default(); STREAMS.len()];
    let mut at_start = None;
    let mut count = 0;
    each_row(&mut source, &mut row, |stream, time, row| {
        let mut observer = |event: &Event<'_>| count += u64::from(matches!(event, Event::Estimate { .. }));
        let before = counter.now();
        let fed = vehicle.feed(stream, time, row, &mut observer);
        let instructions = counter.since(before);
        fed.map_err(|_| "a row was refused")?;
        let cost = &mut costs[stream];
        (cost.rows, cost.all, cost.most) = (cost.rows + 1, cost.all + u64::from(instructions), cost.most.max(instructions));
        if count > 0 {
            at_start.get_or_insert_with(|| ARENA.allocations());
        }
        Ok(())
    })?;
    let later = ARENA.allocations() - at_start.unwrap_or_default();
    let (heap, stack) = (ARENA.most_used(), painted.used());
    drop(vehicle);

    // The same again, for its bits.
    let (mut vehicle, mut digest) = (assemble(), Digest::default());
    each_row(&mut Source::open()?, &mut row, |stream, time, row| {
        vehicle.feed(stream, time, row, &mut digest).map_err(|_| "a row was refused")
    })?;
    vehicle.finish(&mut digest).map_err(|_| "the end was refused")?;

    println!("estimates {} {:016x}", digest.count, digest.hash());
    println!("heap {assembled} {heap}");
    println!("stack {assembling} {stack}");
    println!("allocations {later}");
    for (cost, (name, _)) in costs.iter().zip(STREAMS).filter(|(cost, _)| cost.rows > 0) {
        println!("rows {name} {} {} {}", cost.rows, cost.all / cost.rows, cost.most);
    }
    Ok(())
}

/// Calls `work` with the stream, the stamp and the numbers of each row.
fn each_row(
    source: &mut Source,
    row: &mut [f64; 64],
    mut work: impl FnMut(usize, Time, &[f64]) -> Result<(), &'static str>,
) -> Result<(), &'static str> {
    const CUT: &str = "`rows.bin` ends within a row";
    while let Some(stream) = source.next() {
        let stream = u32::from_le_bytes(stream) as usize;
        let (_, width) = STREAMS.get(stream).ok_or("there is no such stream")?;
        let row = row.get_mut(..*width).ok_or("a row has more than 64 numbers")?;
        let time = i64::from_le_bytes(source.next().ok_or(CUT)?);
        for value in &mut *row {
            *value = f64::from_le_bytes(source.next().ok_or(CUT)?);
        }
        work(stream, Time::from_nanos(time), row)?;
    }
    Ok(())
}

/// The bytes of `rows.bin`, many at a time: each call of semihosting stops the processor.
struct Source {
    file: File,
    bytes: [u8; 1024],
    at: usize,
    end: usize,
}

impl Source {
    fn open() -> Result<Self, &'static str> {
        let file = File::open(c"rows.bin").map_err(|_| "`rows.bin` cannot be read")?;
        Ok(Self {
            file,
            bytes: [0; 1024],
            at: 0,
            end: 0,
        })
    }

    /// The next bytes; `None` at the end of the file.
    fn next<const N: usize>(&mut self) -> Option<[u8; N]> {
        let mut next = [0; N];
        for byte in &mut next {
            if self.at == self.end {
                (self.at, self.end) = (0, self.file.read(&mut self.bytes).ok()?);
            }
            *byte = *self.bytes[..self.end].get(self.at)?;
            self.at += 1;
        }
        Some(next)
    }
}
