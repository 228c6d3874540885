//! Generations of numbers: each differs from all generations before it.

use std::fs;

use gyre_messages::{GivenAnew, Item, NumberedBy};

use super::Run;
use crate::{Generation, generation::skipped};

fn begun(run: &Run, newest: &Item, first: u64) -> (u32, u64) {
    let mut item = Item::default();
    Generation::begin(&run.manifest, NumberedBy::Masking, newest, first)
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
fn of_the_generations_in_between_the_one_with_the_smallest_number_is_known() {
    let run = Run::new();
    let newest = Item::default();
    for (by, first) in [
        (NumberedBy::Masking, 0),
        (NumberedBy::Source, 2),
        (NumberedBy::Masking, 7),
        (NumberedBy::Masking, 9),
        (NumberedBy::Masking, 12),
    ] {
        Generation::begin(&run.manifest, by, &newest, first).unwrap();
    }
    let skipped_by = |by, known, generation| {
        let item = Item {
            generation,
            ..Item::default()
        };
        skipped(&run.manifest.out, by, known, &item).unwrap()
    };
    let given = |generation, first| Some(GivenAnew { generation, first });
    let masking = NumberedBy::Masking;
    assert_eq!(skipped_by(masking, 1, 5), given(3, 7));
    assert_eq!(skipped_by(masking, 3, 5), given(4, 9));
    assert_eq!(skipped_by(masking, 4, 5), None);
    assert_eq!(skipped_by(masking, 1, 3), None, "the source's is another's");
    assert_eq!(skipped_by(NumberedBy::Source, 1, 5), given(2, 2));
    assert_eq!(skipped_by(NumberedBy::Follower, 0, 5), None);
}

#[test]
fn a_program_that_keeps_only_the_number_is_followed() {
    let run = Run::new();
    let path = Generation::path(&run.manifest.out);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, "6").unwrap();
    assert_eq!(begun(&run, &Item::default(), 3), (7, 3));
    assert_eq!(fs::read_to_string(path).unwrap(), "6\n7 3 masking\n");
}

#[test]
fn a_file_without_a_number_is_refused() {
    let run = Run::new();
    begun(&run, &Item::default(), 0);
    let path = run.manifest.out.join("journal").join("generation");
    for text in ["one", "", "2 3\n", "2 3 someone\n", "2 3 masking 4\n"] {
        fs::write(&path, text).unwrap();
        let by = NumberedBy::Masking;
        let error = Generation::begin(&run.manifest, by, &Item::default(), 0).unwrap_err();
        assert!(error.to_string().contains("holds no number"), "{error}");
    }
}
