//! Generations of numbers: each is another one, whatever was before it.

use std::fs;

use gyre_messages::Item;

use super::Run;
use crate::Generation;

fn begun(run: &Run, newest: &Item, first: u64) -> (u32, u64) {
    let mut item = Item::default();
    Generation::begin(&run.manifest, newest, first)
        .unwrap()
        .mark(&mut item);
    (item.generation, item.numbered_from)
}

#[test]
fn each_start_begins_another_generation_also_behind_that_of_the_journal() {
    let run = Run::new();
    let none = Item::default();
    assert_eq!(begun(&run, &none, 0), (1, 0));
    assert_eq!(begun(&run, &none, 0), (2, 0));
    let newest = Item {
        generation: 9,
        ..none
    };
    assert_eq!(begun(&run, &newest, 31), (10, 31));
    assert_eq!(begun(&run, &newest, 31), (11, 31));
}

#[test]
fn a_file_without_a_number_is_refused() {
    let run = Run::new();
    begun(&run, &Item::default(), 0);
    let path = run.manifest.out.join("journal").join("generation");
    fs::write(path, "one").unwrap();
    let error = Generation::begin(&run.manifest, &Item::default(), 0).unwrap_err();
    assert!(error.to_string().contains("holds no number"), "{error}");
}
