use gyre_contract::{Witness, outcome};

use super::*;

const PERIOD_NS: i64 = 250_000_000;
const BEGAN_NS: i64 = 7_000_000_000;
const CLOCK: PlayedClock = PlayedClock {
    first_ns: 0,
    period_ns: PERIOD_NS,
    rate: 1.0,
    end: 200,
};

fn others() -> Others {
    Others {
        used: Witness::ALL.map(|kind| matches!(kind, Witness::Gyro | Witness::Wheels)),
        are_weighed: true,
    }
}

/// The pose of a scan, 20 ms after it was due, with this outcome of its motion.
fn pose(scan: u64, outcome: u32, [gyro, wheels]: [u64; 2]) -> PoseHeader {
    let mut pose = PoseHeader::default();
    (pose.item.seq, pose.item.scan) = (scan, scan);
    pose.item.stamp_ns = scan as i64 * PERIOD_NS;
    pose.item.due_ns = BEGAN_NS + scan as i64 * PERIOD_NS + PERIOD_NS / 2;
    let hop = pose.item.hop_mut(StageId::PoseIntegration);
    hop.published_ns = BEGAN_NS + scan as i64 * PERIOD_NS + PERIOD_NS / 2 + 20_000_000;
    pose.motion.x_m = 2.5;
    let record = &mut pose.motion.refinement;
    record.outcome = outcome;
    record.of_mut(Witness::Gyro).verdict = gyro;
    record.of_mut(Witness::Wheels).verdict = wheels;
    pose
}

const NORMAL: (u32, [u64; 2]) = (outcome::REFINED, [verdict::USED, verdict::USED]);

/// The faults of a scenario after a drive. The scans from one number up to another (excluded)
/// report `meanwhile`.
fn told(
    scenario: Scenario,
    spans: &[(u64, u64)],
    meanwhile: (u32, [u64; 2]),
) -> (Vec<WitnessFault>, Option<String>) {
    let mut told = WitnessFaults::new(faults(scenario), others(), CLOCK, BEGAN_NS);
    for scan in 8..200 {
        let mut spans = spans.iter();
        let is_spoilt = spans.any(|(from, end)| (*from..*end).contains(&scan));
        let (outcome, by) = if is_spoilt { meanwhile } else { NORMAL };
        told.pose(&pose(scan, outcome, by));
    }
    // The vehicle jumps where the recording starts again: nothing there counts.
    told.pose(&pose(200, outcome::PREDICTED, [0, 0]));
    told.finish()
}

#[test]
fn a_gyro_that_is_out_is_noticed_and_the_recovery_counts_from_its_end() {
    // Absent from 4 s to 7 s: scans 16 to 28, the last half covered, and one more.
    let meanwhile = (outcome::REFINED, [verdict::NONE, verdict::USED]);
    let (faults, omitted) = told(Scenario::GyroOut, &[(16, 30)], meanwhile);
    assert_eq!((omitted, faults.len()), (None, 1));
    let fault = &faults[0];
    assert_eq!((fault.motions, fault.noticed), (13, 13));
    // 4 s after the stamp of scan 0, in the middle of its sweep.
    assert!((fault.at_s - 4.0).abs() < 1e-6, "{fault:?}");
    // Scan 30 is stamped 0.5 s after the end, is due half a period later, and its pose 20 ms.
    assert!((fault.recovery_ms.unwrap() - 645.0).abs() < 1e-6);
    assert_eq!(fault.problem(), None);
}

#[test]
fn a_fault_that_nothing_notices_or_that_does_not_end_is_a_problem() {
    let scenarios = Scenario::ALL.into_iter();
    for scenario in scenarios.filter(|scenario| !faults(*scenario).is_empty()) {
        let (unseen, _) = told(scenario, &[], NORMAL);
        let said = unseen[0].problem().unwrap();
        assert!(said.starts_with("nothing has noticed the fault"), "{said}");
        let lost = (outcome::PREDICTED, [verdict::NONE, verdict::REFUSED]);
        let (endless, _) = told(scenario, &[(16, 200)], lost);
        let said = endless[0].problem().unwrap();
        assert!(said.ends_with("was as before it"), "{said}");
    }
    // One of both is not enough where both clocks jump.
    let by_wheels = (outcome::REFINED, [verdict::NONE, verdict::USED]);
    let (half, _) = told(Scenario::ClockJump, &[(16, 33)], by_wheels);
    assert!(half[0].problem().unwrap().starts_with("nothing"));
}

#[test]
fn a_radar_that_is_blind_three_times_recovers_before_the_next_time() {
    let faults = faults(Scenario::RadarBlind);
    let times: Vec<_> = faults.iter().map(|it| [it.from_s, it.ends_s()]).collect();
    assert_eq!(times, [[4.0, 6.0], [10.0, 15.0], [19.0, 29.0]]);
    assert_eq!(needed_s(&faults), 33.0);
    let blind = (outcome::PREDICTED, [verdict::USED, verdict::USED]);
    // The second time lasts until the third begins.
    let spans = [(16, 25), (40, 76), (76, 117)];
    let (told, _) = told(Scenario::RadarBlind, &spans, blind);
    let problems: Vec<_> = told.iter().map(|it| it.problem().is_some()).collect();
    assert_eq!(problems, [false, true, false]);
    let dead = told[0].counts.by_basis[Basis::DeadReckoning as usize];
    assert_eq!((told[0].motions, dead), (9, 9));
}

#[test]
fn without_a_normal_motion_before_a_fault_it_says_nothing() {
    let refused = (outcome::REFINED, [verdict::REFUSED, verdict::USED]);
    let (_, omitted) = told(Scenario::GyroOut, &[(0, 16)], refused);
    assert!(omitted.unwrap().contains("no motion before the fault"));
    let late = WitnessFaults::new(faults(Scenario::GyroOut), others(), CLOCK, BEGAN_NS);
    let (_, omitted) = late.finish();
    assert!(omitted.unwrap().contains("stop other programs"));
}
