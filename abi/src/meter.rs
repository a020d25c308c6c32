//! How much memory work needs in an [`Arena`], measured on a computer with an operating system.
//!
//! The work allocates in an arena as on its target, block by block. A target with 32 bits needs no more: its numbers are
//! as large, and its pointers are half as long.

extern crate std;

use crate::Arena;
use core::alloc::{GlobalAlloc, Layout};
use core::cell::Cell;
use core::hint::black_box;
use core::sync::atomic::{AtomicUsize, Ordering};
use std::alloc::System;
use std::boxed::Box;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread_local;

/// Room for the work; the system gives the pages that are used.
const ROOM: usize = 64 << 20;
const ALIGNED: usize = 64;

static ARENA: Arena = Arena::new();
/// The address of the arena's memory; 0 before the first measurement. Its memory stays for later ones.
static PLACE: AtomicUsize = AtomicUsize::new(0);
/// One measurement at a time.
static ONE: Mutex<()> = Mutex::new(());

thread_local! {
    /// Whether this thread allocates in the arena.
    static IS_WITHIN: Cell<bool> = const { Cell::new(false) };
    /// Bytes of the system that this thread has taken and not given back.
    static HELD: Cell<isize> = const { Cell::new(0) };
    /// Whether the arena had no room for a block.
    static IS_FULL: Cell<bool> = const { Cell::new(false) };
}

/// The allocator of the system, which lets a [`Measurement`] allocate in an arena. A program that measures has it as its
/// `#[global_allocator]`.
#[derive(Debug)]
pub struct Meter;

/// A measurement of this thread.
#[derive(Debug)]
pub struct Measurement {
    _one: MutexGuard<'static, ()>,
    held: isize,
}

impl Measurement {
    /// Begins a measurement; waits for the end of another one. `None` in a program with another allocator than
    /// [`Meter`], and if an earlier measurement has left blocks in the arena.
    #[must_use]
    pub fn begin() -> Option<Self> {
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        if PLACE.load(Ordering::Acquire) == 0 {
            #[expect(unsafe_code, reason = "the memory of an arena")]
            // SAFETY: the block is not empty; it stays for ever, and only the arena uses it.
            unsafe {
                let memory = System.alloc(Layout::from_size_align(ROOM, ALIGNED).ok()?);
                if memory.is_null() {
                    return None;
                }
                ARENA.place(memory, ROOM);
                PLACE.store(memory as usize, Ordering::Release);
            }
        }
        IS_FULL.set(false);
        let measurement = Self {
            _one: one,
            held: HELD.get(),
        };
        let has_meter = ARENA.start_over() && {
            // A compiler may leave out a block that nothing reads.
            let block = measurement.within(|| black_box(Box::new(0_u64)));
            let is_within = ARENA.most_used() > 0;
            drop(block);
            is_within
        };
        (has_meter && ARENA.start_over()).then_some(measurement)
    }

    /// Does a part of the work: this thread allocates in the arena meanwhile. Blocks may be given back later.
    pub fn within<T>(&self, work: impl FnOnce() -> T) -> T {
        let _back = Outside(IS_WITHIN.replace(true));
        work()
    }

    /// The bytes of an arena that the work has needed so far, and those that this thread has taken from the system since
    /// the beginning and not given back. `None` if there was no room for a block.
    #[must_use]
    pub fn bytes(&self) -> Option<(usize, usize)> {
        let held = usize::try_from(HELD.get() - self.held).unwrap_or(0);
        (!IS_FULL.get()).then(|| (ARENA.most_used(), held))
    }
}

/// Ends a part of the work, also if it panics.
struct Outside(bool);

impl Drop for Outside {
    fn drop(&mut self) {
        IS_WITHIN.set(self.0);
    }
}

/// Whether a block is in the arena.
fn is_within(block: *mut u8) -> bool {
    let place = PLACE.load(Ordering::Relaxed);
    place != 0 && (block as usize).wrapping_sub(place) < ROOM
}

/// Counts a block of the system. A thread that ends has no counter any more.
fn count(bytes: isize) {
    let _ = HELD.try_with(|held| held.set(held.get().wrapping_add(bytes)));
}

// SAFETY: a block comes from the system or from the arena, and goes back to where it came from: its address tells.
#[expect(unsafe_code, reason = "an allocator can be written in no other way")]
unsafe impl GlobalAlloc for Meter {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if IS_WITHIN.try_with(Cell::get).unwrap_or(false) {
            // SAFETY: the caller's promise.
            let block = unsafe { ARENA.alloc(layout) };
            if !block.is_null() {
                return block;
            }
            IS_FULL.set(true);
        }
        count(layout.size() as isize);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // The system may have pages of zeros.
        if !IS_WITHIN.try_with(Cell::get).unwrap_or(false) {
            count(layout.size() as isize);
            // SAFETY: the caller's promise.
            return unsafe { System.alloc_zeroed(layout) };
        }
        // SAFETY: the caller's promise; the block is as long as the layout says.
        unsafe {
            let block = self.alloc(layout);
            if !block.is_null() {
                block.write_bytes(0, layout.size());
            }
            block
        }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if is_within(block) {
            // SAFETY: the block is of the arena; the caller's promise.
            return unsafe { ARENA.dealloc(block, layout) };
        }
        count(-(layout.size() as isize));
        // SAFETY: the block is of the system; the caller's promise.
        unsafe { System.dealloc(block, layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !is_within(block) && !IS_WITHIN.try_with(Cell::get).unwrap_or(false) {
            count(size as isize - layout.size() as isize);
            // SAFETY: the block is of the system; the caller's promise.
            return unsafe { System.realloc(block, layout, size) };
        }
        // SAFETY: the caller's promise; both blocks are as long as what is copied.
        unsafe {
            let moved = self.alloc(Layout::from_size_align_unchecked(size, layout.align()));
            if !moved.is_null() {
                moved.copy_from_nonoverlapping(block, size.min(layout.size()));
                self.dealloc(block, layout);
            }
            moved
        }
    }
}
