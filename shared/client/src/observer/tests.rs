//! Observers change nothing for the others, and count the messages that they miss.

use std::{path::Path, rc::Rc, time::Duration};

use gyre_contract::{
    Correction, Fix, Footprint, Gnss, Intake, Item, Loop, LoopHeader, Masked, Message, Motion,
    Objects, Pose, PredictedPose, Refined, Rotation, Scan, flag,
};
use gyre_transport::{
    RunError,
    reader::{Port, Received},
    rig::{Run as Rig, WINDOW, node, reader, send, writer},
    run::{SHARED_MEMORY, own_files},
    transport::Service,
};

use super::{Next, Observer, Run};

/// The sequence number of the next message, and the number of missed messages before it.
fn next(observer: &mut Observer<Pose>) -> Option<(u64, u64)> {
    match observer.next(Duration::ZERO).unwrap() {
        Next::Message(message, missed) => Some((message.item().seq, missed)),
        Next::Idle | Next::Ended => None,
    }
}

#[test]
fn an_observer_counts_what_its_full_queue_lost() {
    let run = Rig::begin();
    let observed = Run::at(&run.manifest.root).unwrap();
    let mut observer = observed.observe::<Pose>().unwrap();
    let poses = writer::<Pose>(&run.manifest);
    send(&poses, 0, 0);
    assert_eq!(next(&mut observer), Some((0, 0)));
    let queue = Pose::sizes(&WINDOW).buffer as u64;
    (1..=queue + 5).for_each(|seq| send(&poses, seq, 0));
    assert_eq!(next(&mut observer), Some((6, 5)));
    assert_eq!(next(&mut observer), Some((7, 0)));
    send(&poses, queue + 20, flag::END);
    while next(&mut observer).is_some() {}
    assert_eq!(observer.missed(), 5 + 14);
    let last = observer.next(Duration::from_secs(5));
    assert!(matches!(last, Ok(Next::Ended)));
}

#[test]
fn a_publisher_has_memory_left_whatever_its_subscribers_hold() {
    let run = Rig::begin();
    let sizes = Pose::sizes(&WINDOW);
    let joined = node(&run.manifest);
    let readers: Vec<_> = (0..sizes.readers)
        .map(|_| Port::<Pose>::open(&joined, &run.manifest).unwrap())
        .collect();
    let observed = Run::at(&run.manifest.root).unwrap();
    let mut observers: Vec<_> = (0..sizes.observers)
        .map(|_| observed.observe::<Pose>().unwrap())
        .collect();
    let poses = writer::<Pose>(&run.manifest);
    // Each holds as many messages as it may, all of them different ones, and its queue overflows.
    let (mut held, mut seq): (Vec<Received<Pose>>, u64) = (Vec::new(), 0);
    let mut overflow = || {
        (0..sizes.buffer).for_each(|_| {
            send(&poses, seq, 0);
            seq += 1;
        });
    };
    for reader in &readers {
        overflow();
        held.extend((0..sizes.borrowed).map(|_| reader.receive().unwrap().unwrap()));
    }
    for observer in &mut observers {
        overflow();
        assert!(next(observer).is_some());
    }
    overflow();
    let mut seqs: Vec<_> = held.iter().map(|message| message.item().seq).collect();
    seqs.dedup();
    assert_eq!(seqs.len(), sizes.readers * sizes.borrowed);
}

#[test]
fn the_footprint_is_what_the_segments_take() {
    let run = Rig::begin();
    let manifest = &run.manifest;
    let _scans = writer::<Scan>(manifest);
    let _rasters = writer::<Masked>(manifest);
    let _rotations = writer::<Rotation>(manifest);
    let _motions = (writer::<Motion>(manifest), writer::<Refined>(manifest));
    let _poses = writer::<Pose>(manifest);
    let _of_slam = (writer::<Loop>(manifest), writer::<Correction>(manifest));
    let _of_localisation = writer::<Fix>(manifest);
    let _of_objects = writer::<Objects>(manifest);
    let _of_a_radar = (writer::<Intake>(manifest), writer::<Gnss>(manifest));
    let _between_scans = writer::<PredictedPose>(manifest);
    let files = own_files(Path::new(SHARED_MEMORY), &manifest.prefix);
    let segments = files.filter(|(path, _)| path.extension().is_some_and(|it| it == "data"));
    let bytes: u64 = segments.map(|(_, file)| file.len()).sum();
    let footprint = Footprint::new(&manifest.window, &manifest.limits);
    let (_, segments) = footprint.segments.split_last().unwrap();
    let expected: usize = segments.iter().map(|(_, bytes)| bytes).sum();
    let share = bytes as f64 / expected as f64;
    assert!((0.9..=1.0).contains(&share), "{bytes} of {expected}");
}

#[test]
fn observers_leave_the_places_of_the_stages_free() {
    let run = Rig::begin();
    let observed = Run::at(&run.manifest.root).unwrap();
    let attached: Vec<_> = (0..WINDOW.observers)
        .map(|_| observed.try_attach::<Pose>(Pose::ENTRY).unwrap())
        .collect();
    let one_too_many = observed.try_attach::<Pose>(Pose::ENTRY).map(drop);
    assert!(matches!(one_too_many, Err(RunError::NoPlace { .. })));
    let readers: Vec<_> = (0..Pose::READERS.len())
        .map(|_| reader::<Pose>(&run.manifest, None))
        .collect();
    // An observer that leaves makes room at once.
    drop(attached);
    assert!(observed.try_attach::<Pose>(Pose::ENTRY).is_ok());
    drop(readers);
}

#[test]
fn an_observer_of_an_earlier_run_does_not_disturb_a_later_one_with_the_same_results() {
    let out = Rc::new(tempfile::tempdir().unwrap());
    let earlier = Rig::writing_to(&out);
    let observed = Run::open(out.path()).unwrap();
    let mut observer = observed.observe::<Pose>().unwrap();
    drop(earlier);
    assert!(matches!(observer.next(Duration::MAX), Ok(Next::Ended)));
    let later = Rig::writing_to(&out);
    drop(observer);
    drop(observed);
    // A restarted stage opens its topics again.
    Service::open(&node(&later.manifest), Pose::ENTRY).unwrap();
    reader::<Pose>(&later.manifest, None);
}

#[test]
fn without_a_run_there_is_nothing_to_observe() {
    let out = tempfile::tempdir().unwrap();
    let refused = Run::open(out.path()).map(drop);
    assert!(matches!(refused, Err(RunError::NotRunning { .. })));
}

#[test]
fn an_observer_that_comes_late_receives_the_last_loops() {
    let run = Rig::begin();
    let loops = writer::<Loop>(&run.manifest);
    let kept = Loop::sizes(&WINDOW).history as u64;
    for seq in 0..kept + 5 {
        let item = Item::numbered(seq);
        let header = LoopHeader {
            item,
            later_seq: seq + 1,
            loops: seq + 1,
            ..LoopHeader::default()
        };
        loops.publish(header, None).unwrap();
    }
    let observed = Run::at(&run.manifest.root).unwrap();
    let mut observer = observed.observe::<Loop>().unwrap();
    loops.accept_readers().unwrap();
    for expected in 5..kept + 5 {
        let Next::Message(message, 0) = observer.next(Duration::ZERO).unwrap() else {
            panic!("no loop {expected}");
        };
        assert_eq!(message.item().seq, expected);
    }
    assert!(matches!(observer.next(Duration::ZERO).unwrap(), Next::Idle));
}

#[test]
fn a_run_without_slam_has_no_loops_to_observe_and_one_without_a_map_no_fixes() {
    let run = Rig::begin();
    let mut manifest = run.manifest.clone();
    manifest.window.slam = false;
    manifest.window.localises = false;
    manifest.write("").unwrap();
    let observed = Run::at(&run.manifest.root).unwrap();
    let refused = observed.observe::<Loop>().map(drop).unwrap_err();
    assert!(refused.to_string().contains("`loop`: only a run with SLAM"));
    let refused = observed.observe::<Fix>().map(drop).unwrap_err();
    assert!(refused.to_string().contains("`fix`: only a run with a map"));
}
