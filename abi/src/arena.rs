//! The memory of a filter: one block that the caller of `fusion_init` places.

use core::alloc::{GlobalAlloc, Layout};
use core::cell::UnsafeCell;
use core::ptr::{NonNull, null_mut};
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use linked_list_allocator::Heap;
use linked_list_allocator::hole::HoleList;

/// An allocator over one block of memory, for one thread. Before [`Arena::place`] it has none.
///
/// The filter allocates while it is assembled and started. An allocation from a second thread, or from an interrupt,
/// during another one is refused.
#[derive(Debug)]
pub struct Arena {
    heap: UnsafeCell<Heap>,
    is_in_use: AtomicBool,
    /// The end of the furthest block, from the start of the memory.
    most_used: AtomicUsize,
    allocations: AtomicUsize,
}

// SAFETY: `heap` is used behind `is_in_use` only, by one caller at a time.
#[expect(unsafe_code, reason = "the boundary to C")]
unsafe impl Sync for Arena {}

impl Default for Arena {
    fn default() -> Self {
        Self::new()
    }
}

#[expect(unsafe_code, reason = "the boundary to C")]
impl Arena {
    /// An arena without memory.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            heap: UnsafeCell::new(Heap::empty()),
            is_in_use: AtomicBool::new(false),
            most_used: AtomicUsize::new(0),
            allocations: AtomicUsize::new(0),
        }
    }

    /// Gives it its memory, once.
    ///
    /// # Safety
    /// `memory` has `bytes` bytes, which nothing else uses from now on.
    pub unsafe fn place(&self, memory: *mut u8, bytes: usize) {
        self.with(|heap| {
            if heap.size() == 0 {
                // SAFETY: the caller's promise; the heap was empty.
                unsafe { heap.init(memory, bytes) }
            }
        });
    }

    /// The bytes from the start of the memory to the end of the furthest block that there ever was: for the same calls,
    /// this much memory is enough.
    #[must_use]
    pub fn most_used(&self) -> usize {
        self.most_used.load(Ordering::Relaxed)
    }

    /// The number of blocks that were allocated.
    #[must_use]
    pub fn allocations(&self) -> usize {
        self.allocations.load(Ordering::Relaxed)
    }

    /// Counts from zero again. Returns false if there still are blocks.
    #[cfg(feature = "meter")]
    pub(crate) fn start_over(&self) -> bool {
        self.most_used.store(0, Ordering::Relaxed);
        self.allocations.store(0, Ordering::Relaxed);
        self.with(|heap| heap.used() == 0) == Some(true)
    }

    /// Calls `work` with the heap, unless it is in use.
    fn with<T>(&self, work: impl FnOnce(&mut Heap) -> T) -> Option<T> {
        if self.is_in_use.swap(true, Ordering::Acquire) {
            return None;
        }
        // SAFETY: `is_in_use` lets one caller in.
        let done = work(unsafe { &mut *self.heap.get() });
        self.is_in_use.store(false, Ordering::Release);
        Some(done)
    }
}

/// The bytes that a block takes of the memory.
fn taken(layout: Layout) -> usize {
    HoleList::align_layout(layout).map_or(layout.size(), |layout| layout.size())
}

// SAFETY: the heap gives blocks of the layout that nothing else has, and keeps them until they are freed.
#[expect(unsafe_code, reason = "the boundary to C")]
unsafe impl GlobalAlloc for Arena {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let block = self.with(|heap| {
            let block = heap.allocate_first_fit(layout).ok()?;
            let end = block.as_ptr() as usize + taken(layout) - heap.bottom() as usize;
            self.most_used.fetch_max(end, Ordering::Relaxed);
            self.allocations.fetch_add(1, Ordering::Relaxed);
            Some(block)
        });
        block.flatten().map_or(null_mut(), NonNull::as_ptr)
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if let Some(block) = NonNull::new(block) {
            // SAFETY: `block` came from `alloc` with this layout. If the heap is in use, the block stays used.
            self.with(|heap| unsafe { heap.deallocate(block, layout) });
        }
    }
}
