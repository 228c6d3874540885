//! Tests of a live run whose radar or its network fails: every scan is published or counted, and
//! the radar is found again.

use std::{
    io::{self, Read, Write},
    net::{TcpListener, TcpStream, UdpSocket},
    thread,
    time::Duration,
};

use gyre_colossus::{Azimuth, ClockFormat, Configuration, asterix, write_keep_alive};
use rustix::process::Signal;

use crate::{
    common::{Run, Running, odometry, recording},
    live::radar::{Played, Radar, group, run_at},
    operate::commands::{ask, await_status},
};

/// Ends a run of a radar that has ended, with a pose of each scan that it has published.
fn interrupt(run: &Run, running: Running) {
    // Waits for datagrams in flight.
    thread::sleep(Duration::from_millis(500));
    await_status(run, "a pose of each scan", |status| {
        let count = |key: &str| status[key].as_u64().unwrap_or_default();
        count("published") == count("poses") + count("dropped")
    });
    running.signal(Signal::INT);
    running.finish();
}

/// A count of the source.
fn count(run: &Run, key: &str) -> u64 {
    run.count(&format!("stages/radar-replay/{key}"))
}

/// Every scan that was played is published or counted, and no more azimuths are missing than were
/// lost, but for those that were on their way when a connection ended.
fn assert_all_counted(run: &Run, played: &Played) {
    let (published, left_out) = (run.count("published"), count(run, "scans_left_out"));
    assert_eq!(
        published + left_out,
        played.scans,
        "{played:?}: {published} published, {left_out} left out, {}",
        run.summary()["stages"]["radar-replay"]
    );
    let missing = count(run, "missing_azimuths");
    // Azimuths of dropped scans are not missing from any scan.
    let of_scans = played.lost_azimuths.saturating_sub(missing);
    assert!(
        missing <= played.lost_azimuths + 400 * left_out && of_scans <= 400 * left_out + 4,
        "{played:?}: {missing} missing"
    );
}

#[test]
fn every_scan_that_a_radar_plays_is_published_or_counted_also_by_a_source_that_dies() {
    let faults = "--lose 0.01 --reset-every 5 --garbage-every 4 --rate 1";
    let faults: Vec<&str> = faults.split(' ').collect();
    let mut radar = Radar::playing(recording::small(), &faults);
    let run = run_at(&radar.address);
    let mut running = run.start();
    running.await_poses(6).kill("radar-replay");
    let played = radar.played();
    interrupt(&run, running);
    run.assert_counts("restarts/radar-replay=1");
    assert_all_counted(&run, &played);
    // The counter includes the killed process: three resets come after it.
    assert!(count(&run, "reconnections") > played.resets.min(3));
    assert!(count(&run, "damaged_messages") >= 1);
    assert!(count(&run, "scans_left_out") >= played.resets);
    odometry::assert_unbroken(&odometry::rows(&run.odometry()));
}

/// Treats a client of a relay in front of a radar.
type Treatment = fn(TcpStream, &str) -> io::Result<()>;

/// Listens for connections, and treats each by this list; all further connections are relayed.
fn relay(radar: &str, all: &'static [Treatment]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let radar = radar.to_owned();
    // They end with the process of the tests.
    thread::spawn(move || {
        for (k, client) in listener.incoming().enumerate() {
            let (client, radar) = (client.unwrap(), radar.clone());
            let treat = all.get(k).copied().unwrap_or(pass_on);
            thread::spawn(move || treat(client, &radar));
        }
    });
    address
}

fn pass_on(mut client: TcpStream, radar: &str) -> io::Result<()> {
    let mut radar = TcpStream::connect(radar)?;
    let (mut requests, mut to_radar) = (client.try_clone()?, radar.try_clone()?);
    thread::spawn(move || io::copy(&mut requests, &mut to_radar));
    io::copy(&mut radar, &mut client).map(|_| ())
}

/// Sends bytes that are no messages.
fn send_junk(mut client: TcpStream, _: &str) -> io::Result<()> {
    for _ in 0..100 {
        client.write_all(&[0x55; 1 << 16])?;
    }
    thread::sleep(Duration::from_secs(5));
    Ok(())
}

/// Describes the radar, and repeatedly reports that it is alive.
fn keep_alive(client: TcpStream, radar: &str) -> io::Result<()> {
    report_life(client, radar, Duration::from_millis(200), 1)
}

/// As above without a pause.
fn flood(client: TcpStream, radar: &str) -> io::Result<()> {
    report_life(client, radar, Duration::ZERO, 4096)
}

fn report_life(mut to: TcpStream, radar: &str, pause: Duration, at_once: usize) -> io::Result<()> {
    let mut described = [0; 256];
    let count = TcpStream::connect(radar)?.read(&mut described)?;
    to.write_all(&described[..count])?;
    let mut alive = Vec::new();
    write_keep_alive(&mut alive);
    let alive = alive.repeat(at_once);
    loop {
        to.write_all(&alive)?;
        thread::sleep(pause);
    }
}

#[test]
fn what_sends_no_azimuths_is_left_and_the_radar_is_found_again() {
    let radar = Radar::playing(recording::small(), &["--repeat"]);
    // Before the run it is asked for its configuration.
    let connections: &[Treatment] = &[pass_on, send_junk, send_junk, keep_alive, flood];
    let run = run_at(&relay(&radar.address, connections)).set("source.scans=12");
    let mut running = run.start();
    running.await_stages();
    // It is not well until azimuths come.
    let deaf = "no azimuths arrive from the radar";
    while !ask(&run, &["ps", "--check"]).stderr.contains(deaf) {
        assert!(running.poses() == 0, "it was never said");
    }
    running.finish().succeeded();
    run.assert_counts("published=12 stages/radar-replay/reconnections=4");
    let log = run.result("log.jsonl");
    for words in ["it does not speak Colossus", "it sent no azimuth for 1s"] {
        assert!(log.contains(words), "{log}");
    }
}

#[test]
fn datagrams_of_others_are_passed_over_and_counted() {
    let to = group(5);
    let radar = Radar::sending(&to, recording::small(), &["--repeat"]);
    let run = radar.received(12);
    let mut running = run.started(2);
    let options = ["--repeat", "--rate", "1"];
    let _other = Radar::to(&["--udp", &to], recording::small(), &options);
    let forger = UdpSocket::bind("127.0.0.1:0").unwrap();
    let large = Configuration::usual(400, 60_000);
    let azimuth = Azimuth::at(14, 0, ClockFormat::default(), &[9; 4]);
    let mut number = 0;
    while !running.is_over() {
        asterix::write_azimuth(&large, &azimuth, &mut number, &mut |datagram| {
            forger.send_to(datagram, &to).unwrap();
        });
        thread::sleep(Duration::from_millis(20));
    }
    running.finish().succeeded();
    run.assert_counts("published=12 stages/radar-replay/reconnections=0");
    // Some of each: a scan of the other, and one datagram in 20 ms.
    assert!(count(&run, "foreign_messages") > 100);
    assert!(run.result("log.jsonl").contains("give each radar a group"));
}

#[test]
fn a_radar_that_is_silent_is_waited_for_by_name_until_it_sends_again() {
    let mut radar = Radar::playing(recording::small(), &["--rate", "4"]);
    let run = run_at(&radar.address);
    let mut running = run.start();
    radar.played();
    let waits = format!("waiting for the radar at {}: no scan", radar.address);
    running.await_words(&format!("{waits} for 3 s"));
    await_status(&run, "the wait for the radar", |status| {
        status["phase"] == "waiting-for-radar"
    });
    running.await_words("no scan for 6 s");
    let again = Radar::to(&["--listen", &radar.address], recording::small(), &[]);
    running.await_words(&format!("the radar at {} sends, after ", again.address));
    running.signal(Signal::INT);
    running.finish();
}
