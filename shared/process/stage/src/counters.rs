//! The counters of a stage, and of the heap allocations, to measure that `process` does not
//! allocate.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    fs,
    path::PathBuf,
};

use gyre_contract::run::StageCounters;

use gyre_transport::{Manifest, RunError, clock, run};

fn path_of(manifest: &Manifest, stage: &str) -> PathBuf {
    manifest.root.join(format!("{stage}.counters.json"))
}

/// Items that may allocate, since buffers grow at first.
const WARM_UP: u64 = 5;

/// Reads the counters of a stage; `None` if it has not exited cleanly.
#[must_use]
pub fn read(manifest: &Manifest, stage: &str) -> Option<StageCounters> {
    let text = fs::read_to_string(path_of(manifest, stage)).ok()?;
    serde_json::from_str(&text).ok()
}

pub(crate) fn write(
    counters: &StageCounters,
    manifest: &Manifest,
    stage: &str,
) -> Result<(), RunError> {
    let text = serde_json::to_string(counters).map_err(|e| RunError::Input(e.to_string()))?;
    run::write(path_of(manifest, stage), &text)
}

pub(crate) fn record(counters: &mut StageCounters, allocations: u64, busy_ns: i64) {
    if allocations_are_counted() {
        let count = match counters.processed < WARM_UP {
            true => &mut counters.allocations_in_first_five,
            false => &mut counters.allocations_after_five,
        };
        *count.get_or_insert(0) += allocations;
    }
    counters.processed += 1;
    counters.busy_ns += busy_ns.max(0) as u64;
}

pub(crate) struct Work {
    pub started_ns: i64,
    allocated: u64,
}

impl Work {
    pub fn begin() -> Self {
        Self {
            started_ns: clock::now_ns(),
            allocated: allocations_so_far(),
        }
    }

    /// Counts the work; returns its end, ns.
    pub fn end(&self, counters: &mut StageCounters) -> i64 {
        let finished_ns = clock::now_ns();
        let allocations = allocations_so_far() - self.allocated;
        record(counters, allocations, finished_ns - self.started_ns);
        finished_ns
    }
}

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

fn allocations_so_far() -> u64 {
    COUNT.with(Cell::get)
}

fn allocations_are_counted() -> bool {
    // Every stage allocates before its first item.
    allocations_so_far() > 0
}

#[cfg(test)]
mod tests {
    use super::{CountingAllocator, allocations_are_counted, allocations_so_far as so_far};

    #[global_allocator]
    static ALLOCATOR: CountingAllocator = CountingAllocator;

    #[test]
    fn an_allocation_is_counted_once_and_its_release_is_not() {
        let before = so_far();
        drop(std::hint::black_box(Box::new(7)));
        assert_eq!(so_far() - before, 1);
        assert!(allocations_are_counted());
    }
}
