//! After construction, describing, querying and verifying places allocate nothing.
#![allow(unsafe_code)]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use gyre_geometry::pose;
use gyre_matching::RefinementConfig;
use gyre_slam::estimation::places::{Describer, Descriptor, PlaceIndex, Registrar};

use crate::estimation::places::scenes;

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
fn describing_querying_and_verifying_allocate_nothing() {
    let submaps: Vec<_> = (0..40)
        .map(|seed| scenes::seen(&scenes::place(seed), &pose(0.0, 0.0, 0.02 * seed as f64)))
        .collect();
    let (mut describer, mut descriptor) = (Describer::new(), Descriptor::default());
    let mut index = PlaceIndex::with_capacity(submaps.len());
    for (k, submap) in submaps.iter().enumerate() {
        describer.describe(submap, &mut descriptor);
        index
            .insert(k as u64, 20.0 * k as f64, &descriptor)
            .unwrap();
    }
    let mut registrar = Registrar::new(&RefinementConfig::default(), 8192).unwrap();
    let before = ALLOCATIONS.with(Cell::get);
    describer.describe(&submaps[7], &mut descriptor);
    let found = index.query(&descriptor, 40, 15.0)[0];
    registrar.verify(&submaps[7], &submaps[found.place], &found);
    assert_eq!((ALLOCATIONS.with(Cell::get), found.place), (before, 7));
}
