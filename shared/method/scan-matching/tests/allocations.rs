//! After construction the searches allocate nothing.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use crate::common::{Motion, pair, scenes};
use gyre_scan_matching::{
    ExhaustiveConfig, ExhaustiveSearch, RotationConfig, RotationSearch, TranslationConfig,
    TranslationSearch,
};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: hands every call on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn searches_allocate_nothing_after_construction() {
    let (n, cell_m) = (127, 0.8);
    let (earlier, later) = pair(n, cell_m, Motion::degrees(2.0, 1.0, 5.0), 1);
    for phase_only in [false, true] {
        let config = RotationConfig {
            phase_only,
            ..RotationConfig::default()
        };
        let mut rotation = RotationSearch::new(n, &config).unwrap();
        let config = TranslationConfig {
            phase_only,
            ..TranslationConfig::default()
        };
        let mut translation = TranslationSearch::new(n, cell_m, &config).unwrap();
        let (mut f, mut g) = (rotation.new_spectrum(), rotation.new_spectrum());
        let before = ALLOCATIONS.with(Cell::get);
        rotation.spectrum(earlier.view(), &mut g).unwrap();
        rotation.spectrum(later.view(), &mut f).unwrap();
        let angle = rotation.search(&f, &g, None).unwrap();
        translation
            .search(later.view(), earlier.view(), &angle)
            .unwrap();
        let after = ALLOCATIONS.with(Cell::get);
        assert_eq!(after, before, "phase_only {phase_only}");
    }
    let mut exhaustive = ExhaustiveSearch::new(n, cell_m, &ExhaustiveConfig::default()).unwrap();
    let before = ALLOCATIONS.with(Cell::get);
    exhaustive.search(later.view(), earlier.view()).unwrap();
    assert_eq!(ALLOCATIONS.with(Cell::get), before, "exhaustive");
}

#[test]
fn the_refinement_allocates_nothing_after_construction() {
    let drive = scenes::Drive::steady(10.0, 4.0, 40);
    let mut scans = scenes::scans(
        &scenes::town([[-100.0, 200.0]; 2], 1),
        &drive,
        &scenes::Sensor::default(),
    );
    scans[20..30].iter_mut().for_each(Vec::clear); // a new map starts
    let mut refiner = scenes::refiner();
    let before = ALLOCATIONS.with(Cell::get);
    for k in (1..scans.len()).chain([1]) {
        if k == 1 {
            refiner.reset();
        }
        let searched = scenes::searched(&drive, k - 1);
        let (later, earlier) = (&scans[k], &scans[k - 1]);
        refiner.refine(k as u64, later, earlier, &searched, scenes::SWEEP_S);
    }
    assert_eq!(ALLOCATIONS.with(Cell::get), before);
}
