//! The one filter of a program, behind the functions of `fusion.h`.

use crate::arena::Arena;
use crate::state::{State, Status};
use core::cell::UnsafeCell;
use core::slice;
use core::sync::atomic::{AtomicBool, Ordering};
use fusion_vehicle::fusion_core::Time;
use fusion_vehicle::fusion_core::runner::Event;
use fusion_vehicle::{FeedError, Vehicle};

/// A place for one filter. All its calls return at once if another call has not returned.
#[derive(Debug)]
pub struct Filter {
    vehicle: UnsafeCell<Option<Vehicle>>,
    is_in_use: AtomicBool,
}

// SAFETY: `vehicle` is used behind `is_in_use` only, by one caller at a time.
#[expect(unsafe_code, reason = "the boundary to C")]
unsafe impl Sync for Filter {}

impl Default for Filter {
    fn default() -> Self {
        Self::new()
    }
}

#[expect(unsafe_code, reason = "the boundary to C")]
impl Filter {
    /// No filter yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            vehicle: UnsafeCell::new(None),
            is_in_use: AtomicBool::new(false),
        }
    }

    fn with(&self, work: impl FnOnce(&mut Option<Vehicle>) -> Status) -> Status {
        if self.is_in_use.swap(true, Ordering::Acquire) {
            return Status::Busy;
        }
        // SAFETY: `is_in_use` lets one caller in.
        let done = work(unsafe { &mut *self.vehicle.get() });
        self.is_in_use.store(false, Ordering::Release);
        done
    }

    fn with_vehicle(&self, work: impl FnOnce(&mut Vehicle) -> Status) -> Status {
        self.with(|vehicle| vehicle.as_mut().map_or(Status::NotInitialised, work))
    }

    /// Assembles the filter in `memory`.
    ///
    /// # Safety
    /// `memory` has `bytes` bytes, which nothing else uses from now on.
    pub unsafe fn init(&self, arena: &Arena, memory: *mut u8, bytes: usize, assemble: fn() -> Vehicle) -> Status {
        self.with(|vehicle| {
            if memory.is_null() || bytes == 0 {
                return Status::Null;
            }
            if vehicle.is_some() {
                return Status::AlreadyInitialised;
            }
            // SAFETY: the caller's promise.
            unsafe { arena.place(memory, bytes) }
            *vehicle = Some(assemble());
            Status::Ok
        })
    }

    /// Feeds a row of a stream, stamped `time` \[ns\].
    ///
    /// # Safety
    /// `row` has `width` numbers.
    pub unsafe fn feed(&self, stream: u32, time: i64, row: *const f64, width: usize) -> Status {
        if row.is_null() {
            return Status::Null;
        }
        // SAFETY: the caller's promise.
        let row = unsafe { slice::from_raw_parts(row, width) };
        self.with_vehicle(|vehicle| {
            let mut nobody = |_: &Event<'_>| {};
            match vehicle.feed(stream as usize, Time::from_nanos(time), row, &mut nobody) {
                Ok(()) => Status::Ok,
                Err(FeedError::Stream { .. }) => Status::NoStream,
                Err(FeedError::Impossible { .. }) => Status::Impossible,
                Err(FeedError::Run(_)) => Status::Width,
            }
        })
    }

    /// Processes what has been held back: the end of the data.
    pub fn finish(&self) -> Status {
        self.with_vehicle(|vehicle| {
            // An observer that hears nothing has no error.
            let _ = vehicle.finish(&mut |_: &Event<'_>| {});
            Status::Ok
        })
    }

    /// Writes the newest solution.
    ///
    /// # Safety
    /// `out` points to a state, or is null.
    pub unsafe fn state(&self, out: *mut State) -> Status {
        self.with_vehicle(|vehicle| {
            let health = vehicle.health();
            let state = vehicle.solution().map(|solution| State::new(solution, health));
            // SAFETY: the caller's promise.
            unsafe { write(out, state) }
        })
    }

    /// Writes the solution at `time` \[ns\]. The filter is unchanged.
    ///
    /// # Safety
    /// `out` points to a state, or is null.
    pub unsafe fn predict(&self, time: i64, out: *mut State) -> Status {
        self.with_vehicle(|vehicle| {
            let health = vehicle.health();
            let state = vehicle
                .predict(Time::from_nanos(time))
                .map(|solution| State::new(&solution, health));
            // SAFETY: the caller's promise.
            unsafe { write(out, state) }
        })
    }

    /// Writes a checkpoint, if there is room for it. Returns its bytes; 0 without a filter.
    ///
    /// # Safety
    /// `out` has room for `capacity` bytes, or is null.
    pub unsafe fn checkpoint(&self, out: *mut u8, capacity: usize) -> usize {
        let mut length = 0;
        self.with_vehicle(|vehicle| {
            let bytes = vehicle.checkpoint();
            length = bytes.len();
            if !out.is_null() && length <= capacity {
                // SAFETY: there is room, by the caller's promise.
                unsafe { out.copy_from_nonoverlapping(bytes.as_ptr(), length) }
            }
            Status::Ok
        });
        length
    }

    /// Resumes from a checkpoint of this design.
    ///
    /// # Safety
    /// `bytes` has `length` bytes, or is null.
    pub unsafe fn restore(&self, bytes: *const u8, length: usize) -> Status {
        if bytes.is_null() {
            return Status::Null;
        }
        // SAFETY: the caller's promise.
        let bytes = unsafe { slice::from_raw_parts(bytes, length) };
        self.with_vehicle(|vehicle| vehicle.restore(bytes).map_or(Status::Checkpoint, |()| Status::Ok))
    }
}

/// Writes a state, if there is one.
///
/// # Safety
/// `out` points to a state, or is null.
#[expect(unsafe_code, reason = "the boundary to C")]
unsafe fn write(out: *mut State, state: Option<State>) -> Status {
    let Some(state) = state else {
        return Status::NotStarted;
    };
    if out.is_null() {
        return Status::Null;
    }
    // SAFETY: the caller's promise.
    unsafe { out.write(state) }
    Status::Ok
}
