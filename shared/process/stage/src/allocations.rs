//! Counts of heap allocations, to measure that `process` does not allocate.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

/// The system allocator with a count of the allocations of each thread. A program that makes it its
/// global allocator has the allocations of its stages counted:
///
/// ```
/// #[global_allocator]
/// static ALLOCATOR: gyre_stage::CountingAllocator = gyre_stage::CountingAllocator;
/// # fn main() {}
/// ```
#[derive(Debug)]
pub struct CountingAllocator;

fn count() {
    // A thread that is being torn down has no counter.
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call is forwarded to the system allocator unchanged; counting neither allocates nor
// panics.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        unsafe { System.dealloc(block, layout) }
    }
}

pub(crate) fn so_far() -> u64 {
    COUNT.with(Cell::get)
}

pub(crate) fn are_counted() -> bool {
    // Every stage allocates before its first item.
    so_far() > 0
}

#[cfg(test)]
mod tests {
    use super::{CountingAllocator, are_counted, so_far};

    #[global_allocator]
    static ALLOCATOR: CountingAllocator = CountingAllocator;

    #[test]
    fn an_allocation_is_counted_once_and_its_release_is_not() {
        let before = so_far();
        drop(std::hint::black_box(Box::new(7)));
        assert_eq!(so_far() - before, 1);
        assert!(are_counted());
    }
}
