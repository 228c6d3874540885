//! Generations of numbers: each differs from all generations before it.

use std::fs;

use gyre_contract::{GivenAnew, Item, NumberedBy};

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
    let run = Run::begin();
    let item = |generation| Item {
        generation,
        ..Item::default()
    };
    for (newest, first, generation) in [(0, 0, 1), (0, 0, 2), (9, 31, 10), (9, 31, 11)] {
        assert_eq!(begun(&run, &item(newest), first), (generation, first));
    }
    // A program in the place of masking may keep only the number.
    let path = Generation::path(&run.manifest.out);
    fs::write(&path, "6").unwrap();
    assert_eq!(begun(&run, &item(0), 3), (7, 3));
    assert_eq!(fs::read_to_string(&path).unwrap(), "6\n7 3 masking\n");
    for text in ["one", "", "2 3\n", "2 3 someone\n", "2 3 masking 4\n"] {
        fs::write(&path, text).unwrap();
        let by = NumberedBy::Masking;
        let error = Generation::begin(&run.manifest, by, &item(0), 0).unwrap_err();
        assert!(error.to_string().contains("holds no number"), "{error}");
    }
}

#[test]
fn of_the_generations_in_between_the_one_with_the_smallest_number_is_known() {
    let run = Run::begin();
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
