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

    let painted = Painted::new();
    let mut vehicle = assemble();
    let assembled = ARENA.most_used();
    let mut costs = [Cost::default(); STREAMS.len()];
    let mut at_start = None;
    let mut count = 0;
    each_row(|stream, time, row| {
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
    each_row(|stream, time, row| vehicle.feed(stream, time, row, &mut digest).map_err(|_| "a row was refused"))?;
    vehicle.finish(&mut digest).map_err(|_| "the end was refused")?;

    println!("estimates {} {:016x}", digest.count, digest.hash());
    println!("heap {assembled} {heap}");
    println!("stack {stack}");
    println!("allocations {later}");
    for (cost, (name, _)) in costs.iter().zip(STREAMS).filter(|(cost, _)| cost.rows > 0) {
        println!("rows {name} {} {} {}", cost.rows, cost.all / cost.rows, cost.most);
    }
    Ok(())
}

/// Calls `work` with the stream, the stamp and the numbers of each row.
fn each_row(mut work: impl FnMut(usize, Time, &[f64]) -> Result<(), &'static str>) -> Result<(), &'static str> {
    let mut source = File::open(c"rows.bin").map_err(|_| "`rows.bin` cannot be read")?;
    let mut row = [0.0; 64];
    let (mut stream, mut time, mut number) = ([0; 4], [0; 8], [0; 8]);
    while source.read_exact(&mut stream).is_ok() {
        let stream = u32::from_le_bytes(stream) as usize;
        let (_, width) = STREAMS.get(stream).ok_or("there is no such stream")?;
        let row = row.get_mut(..*width).ok_or("a row has more than 64 numbers")?;
        source.read_exact(&mut time).map_err(|_| "`rows.bin` ends within a row")?;
        for value in &mut *row {
            source.read_exact(&mut number).map_err(|_| "`rows.bin` ends within a row")?;
            *value = f64::from_le_bytes(number);
        }
        work(stream, Time::from_nanos(i64::from_le_bytes(time)), row)?;
    }
    Ok(())
}
