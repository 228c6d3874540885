//! Loops depend on the keyframes, and not on when they come or on where the closing is stopped.

use std::convert::Infallible;

use crate::common::{AROUND, Drive};
use gyre_matching::RefinementConfig;
use gyre_slam::{LoopCloser, LoopOutcome, Place, Query, Record, SUBMAP_REACH_M};

const KEYFRAMES: usize = 2 * AROUND + 20;

fn closer() -> LoopCloser {
    LoopCloser::new(SUBMAP_REACH_M, &RefinementConfig::default(), 400).unwrap()
}

fn encoded(record: &impl Record) -> Vec<u8> {
    let mut bytes = Vec::new();
    record.encode(&mut bytes);
    bytes
}

#[derive(Clone, Default, PartialEq)]
struct Logs {
    places: Vec<Vec<u8>>,
    queries: Vec<Vec<u8>>,
}

impl Logs {
    fn advance(&mut self, closer: &mut LoopCloser, drive: &Drive) {
        let mut read = |index: usize| Ok::<_, Infallible>(drive.keyframes[index].clone());
        while let Some(place) = closer.describe(&mut read).unwrap() {
            self.places.push(encoded(&place));
        }
        while let Some(query) = closer.close(&mut read).unwrap() {
            self.queries.push(encoded(&query));
        }
    }

    fn complete(mut self, drive: &Drive) -> Self {
        let mut closer = closer();
        for place in &self.places {
            let place = Place::decode(place).unwrap();
            closer.restore_place::<()>(&place).unwrap();
        }
        closer.restore_queries(self.queries.len());
        for k in closer.keyframes()..drive.keyframes.len() {
            closer.push(&drive.keyframes[k]).unwrap();
            self.advance(&mut closer, drive);
        }
        closer.finish();
        self.advance(&mut closer, drive);
        self
    }
}

#[test]
fn a_place_that_is_visited_again_is_a_loop_with_its_motion() {
    let drive = Drive::new(KEYFRAMES, 1);
    let logs = Logs::default().complete(&drive);
    assert_eq!(
        (logs.places.len(), logs.queries.len()),
        (KEYFRAMES, KEYFRAMES)
    );
    for (k, query) in logs.queries.iter().enumerate() {
        let query = Query::decode(query).unwrap();
        assert_eq!(query.keyframe, k);
        assert!(k >= 50 || query.candidates.is_empty(), "{k}");
        for (candidate, closing) in query.loops() {
            assert!(candidate.correlation > 0.65 && candidate.chi_square < 16.3);
            let truth = drive.truth[closing.from].inv_mul(&drive.truth[closing.to]);
            assert!(closing.motion.error(&truth).norm() < 0.1, "{k}");
        }
        assert!(k < AROUND || query.loops().count() > 0, "{k}");
    }
}

#[test]
fn loops_do_not_depend_on_where_the_closer_was_stopped_and_what_is_left_of_its_logs() {
    let drive = Drive::new(KEYFRAMES, 2);
    let whole = Logs::default().complete(&drive);
    // All keyframes at once.
    let mut at_once = Logs::default();
    let mut closer = closer();
    drive
        .keyframes
        .iter()
        .for_each(|it| closer.push(it).unwrap());
    closer.finish();
    at_once.advance(&mut closer, &drive);
    assert!(at_once == whole);
    for (places, queries) in [
        (1, 0),
        (AROUND + 7, AROUND / 2),
        (KEYFRAMES - 3, KEYFRAMES - 3),
        (KEYFRAMES, KEYFRAMES / 2),
    ] {
        let logs = Logs {
            places: whole.places[..places].to_vec(),
            queries: whole.queries[..queries].to_vec(),
        };
        assert!(logs.complete(&drive) == whole, "{places}, {queries}");
    }
}

#[test]
fn a_loop_that_contradicts_the_odometry_is_rejected_with_the_reason() {
    let mut drive = Drive::new(KEYFRAMES, 3);
    // Odometry that claims to be a hundred times as exact as it is.
    for keyframe in &mut drive.keyframes {
        keyframe.motion.covariance *= 1e-4;
    }
    let logs = Logs::default().complete(&drive);
    let queries = logs.queries.iter().map(|it| Query::decode(it).unwrap());
    let candidates: Vec<_> = queries.flat_map(|it| it.candidates).collect();
    let rejected = |it: &&gyre_slam::LoopCandidate| it.outcome == LoopOutcome::ContradictsOdometry;
    assert!(
        candidates
            .iter()
            .filter(rejected)
            .all(|it| it.chi_square > 16.266)
    );
    assert!(candidates.iter().filter(rejected).count() > 10);
}

#[test]
fn bytes_that_are_neither_a_place_nor_a_query_are_refused() {
    let drive = Drive::new(30, 4);
    let logs = Logs::default().complete(&drive);
    let (place, query) = (&logs.places[0], &logs.queries[0]);
    assert!(Place::decode(&place[1..]).is_none() && Place::decode(&[]).is_none());
    assert!(Query::decode(&query[1..]).is_none() && Query::decode(&[]).is_none());
}
