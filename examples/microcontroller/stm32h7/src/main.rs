//! A filter on an STM32H743. Rows come over USART3, the serial line of the debugger of a NUCLEO board; the solution goes
//! back after each.
//!
//! ```text
//! in    stream u32, stamp in nanoseconds i64, numbers f64: a row, as `fusion compile --rows` writes them
//! out   stamp i64; latitude, longitude, height, velocity north, east, down f64; health u8: 57 bytes
//! ```
//!
//! All little-endian. A vehicle reads its sensors in place of `Line::row`.

#![no_std]
#![no_main]

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use cortex_m_rt::entry;
use filter::{STREAMS, assemble};
use fusion_abi::Arena;
use fusion_abi::fusion_vehicle::Vehicle;
use fusion_abi::fusion_vehicle::fusion_core::Time;
use fusion_abi::fusion_vehicle::fusion_core::runner::Event;
use nb::block;
use stm32h7xx_hal::pac::{Peripherals, USART3};
use stm32h7xx_hal::prelude::*;
use stm32h7xx_hal::serial::{Rx, Tx};

#[global_allocator]
static ARENA: Arena = Arena::new();

const ROOM: usize = filter::MEMORY;
static mut MEMORY: MaybeUninit<[u8; ROOM]> = MaybeUninit::uninit();

/// The serial line.
struct Line {
    rx: Rx<USART3>,
    tx: Tx<USART3>,
}

impl Line {
    /// The next bytes. A byte that was received with an error is left out, as if it were lost.
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let mut next = 0;
        while next < N {
            if let Ok(byte) = block!(self.rx.read()) {
                bytes[next] = byte;
                next += 1;
            }
        }
        bytes
    }

    /// The next row: its stream, its stamp and its numbers, which are in the first places of `row`.
    fn row(&mut self, row: &mut [f64; 64]) -> Option<(usize, Time, usize)> {
        let stream = u32::from_le_bytes(self.bytes()) as usize;
        let time = Time::from_nanos(i64::from_le_bytes(self.bytes()));
        let (_, width) = *STREAMS.get(stream)?;
        for number in row.get_mut(..width)? {
            *number = f64::from_le_bytes(self.bytes());
        }
        Some((stream, time, width))
    }

    fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            // This error does not exist.
            let _ = block!(self.tx.write(*byte));
        }
    }

    fn solution(&mut self, vehicle: &mut Vehicle) {
        let health = vehicle.health() as u8;
        let Some(solution) = vehicle.solution() else { return };
        let (place, _) = solution.position.unwrap_or_default();
        let (velocity, _) = solution.velocity.unwrap_or_default();
        self.send(&solution.time.nanos().to_le_bytes());
        for number in [place.lat, place.lon, place.height, velocity.x, velocity.y, velocity.z] {
            self.send(&number.to_le_bytes());
        }
        self.send(&[health]);
    }
}

/// The line at 921,600 bit/s, with the processor at 400 MHz; `None` if the peripherals are taken.
fn line() -> Option<Line> {
    let device = Peripherals::take()?;
    let power = device.PWR.constrain().freeze();
    let clocks = device.RCC.constrain().sys_ck(400.MHz()).freeze(power, &device.SYSCFG);
    let pins = device.GPIOD.split(clocks.peripheral.GPIOD);
    let pins = (pins.pd8.into_alternate(), pins.pd9.into_alternate());
    let serial = device.USART3.serial(pins, 921_600.bps(), clocks.peripheral.USART3, &clocks.clocks);
    let (tx, rx) = serial.ok()?.split();
    Some(Line { rx, tx })
}

#[entry]
fn main() -> ! {
    // SAFETY: nothing else uses this block.
    unsafe { ARENA.place((&raw mut MEMORY).cast(), ROOM) }
    let mut vehicle = assemble();
    let mut row = [0.0; 64];
    if let Some(mut line) = line() {
        while let Some((stream, time, width)) = line.row(&mut row) {
            // A row that is refused changes nothing: the next solution has an older stamp.
            let _ = vehicle.feed(stream, time, &row[..width], &mut |_: &Event<'_>| {});
            line.solution(&mut vehicle);
        }
    }
    // The line is out of step: start again.
    cortex_m::peripheral::SCB::sys_reset()
}

/// The watchdog of a vehicle would start the program again; here it does so itself.
#[panic_handler]
fn panicked(_: &PanicInfo<'_>) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
