//! Replays rows in an emulator, and prints what they cost. The estimates have the bits of the host.
//!
//! It reads `rows.bin`, which `fusion compile --rows` writes, over semihosting. A program on a vehicle reads its sensors
//! in place of it: see the chapter *On a microcontroller* of the book.

#![no_std]
#![no_main]

mod board;
mod rows;
mod stack;

use board::Counter;
use core::mem::MaybeUninit;
use filter::{STREAMS, assemble};
use fusion_abi::Arena;
use fusion_abi::fusion_vehicle::Digest;
use fusion_abi::fusion_vehicle::fusion_core::Time;
use fusion_abi::fusion_vehicle::fusion_core::runner::Event;
use rows::{Cost, Source};
use semihosting::{println, process};
use stack::Painted;

#[global_allocator]
static ARENA: Arena = Arena::new();

/// As much as the compiler says: with less, the program ends.
const ROOM: usize = filter::MEMORY;
static mut MEMORY: MaybeUninit<[u8; ROOM]> = MaybeUninit::uninit();

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
    let widths = STREAMS.map(|(_, width)| width);

    let painted = Painted::new();
    let mut vehicle = assemble();
    let (assembled, assembling) = (ARENA.most_used(), painted.used());
    let painted = Painted::new();
    let mut costs = [Cost::default(); STREAMS.len()];
    let mut at_start = None;
    let mut count = 0;
    source.each_row(&widths, &mut row, |stream, time, row| {
        let mut observer = |event: &Event<'_>| count += u64::from(matches!(event, Event::Estimate { .. }));
        let before = counter.now();
        let fed = vehicle.feed(stream, Time::from_nanos(time), row, &mut observer);
        let instructions = counter.since(before);
        fed.map_err(|_| "a row was refused")?;
        costs[stream].add(instructions);
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
    Source::open()?.each_row(&widths, &mut row, |stream, time, row| {
        vehicle
            .feed(stream, Time::from_nanos(time), row, &mut digest)
            .map_err(|_| "a row was refused")
    })?;
    vehicle.finish(&mut digest).map_err(|_| "the end was refused")?;

    println!("estimates {} {:016x}", digest.count, digest.hash());
    println!("heap {assembled} {heap} {ROOM}");
    println!("stack {assembling} {stack}");
    println!("allocations {later}");
    for (cost, (name, _)) in costs.iter().zip(STREAMS) {
        cost.print(name);
    }
    Ok(())
}
