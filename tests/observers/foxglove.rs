//! `gyre watch --foxglove`: messages to an independent viewer, access, and a viewer that never
//! reads.

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Write},
    net::TcpStream,
};

use gyre_client::Usage;
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::{
    common::{Ended, Run, Running, Server, asked, odometry, recording, script},
    reach::{only_if, python_has},
};

/// Bytes before the powers in each row of an image: the azimuth, its time and its flag.
const ROW_HEADER: usize = 11;

/// A drive of 120 scans, half a minute at rate 1.
fn driving(rate: &str) -> Run {
    let data = recording::around_a_block().to_str().unwrap();
    Run::small().option(data).rate(rate)
}

fn started(run: &Run) -> (Running, Server) {
    let running = run.started(1);
    let options = ["--foxglove", "127.0.0.1:0"];
    (running, Server::start(run, "127.0.0.1", &options))
}

/// The results of a run by the time of the scan, ns: two columns of numbers.
fn places(csv: &str, columns: [&str; 3]) -> BTreeMap<String, [f64; 2]> {
    let rows = odometry::columns(csv, &columns).into_iter();
    rows.map(|row| {
        let [x, y] = [&row[1], &row[2]].map(|field| field.parse().unwrap());
        (row[0].clone(), [x, y])
    })
    .collect()
}

#[test]
fn a_viewer_receives_the_scans_of_the_recording_and_the_motions_of_the_results() {
    only_if!(python_has("mcap_protobuf, websockets"));
    let run = driving("1");
    let (running, server) = started(&run);
    let mut viewer = script("observers/foxglove.py");
    viewer.args([&server.foxglove(), "8"]);
    let ended = Ended::of(viewer);
    ended.succeeded();
    running.interrupt();
    server.interrupt();

    let received: Value = serde_json::from_str(&ended.stdout).unwrap();
    let of = |topic: &str| received[topic].as_object().unwrap();
    let motions = places(&run.odometry(), ["stamp_ns", "x_m", "y_m"]);
    let poses = places(&run.result("poses.csv"), ["stamp_ns", "x_m", "y_m"]);
    for (topic, written) in [("/refined", motions), ("/pose", poses)] {
        let seen = of(topic);
        let both: Vec<_> = written
            .iter()
            .filter(|it| seen.contains_key(it.0))
            .collect();
        assert!(seen.len() > 4 && both.len() > 2, "{topic}: {}", both.len());
        for (stamp_ns, written) in both {
            for axis in 0..2 {
                let apart_m = seen[stamp_ns][axis].as_f64().unwrap() - written[axis];
                assert!(apart_m.abs() < 1e-8, "{topic} {stamp_ns}: {apart_m}");
            }
        }
    }
    let images = recording::images(recording::around_a_block());
    let images: Vec<_> = images.iter().map(|path| powers(path)).collect();
    for scan in of("/scan").values() {
        assert!(images.contains(scan), "{scan} is no image of the recording");
    }
    let first = |topic: &str| of(topic).values().next().unwrap();
    let masked = first("/masked");
    let cells = masked[1].as_u64().unwrap() * masked[2].as_u64().unwrap();
    assert_eq!(masked[3], 4 * cells);
    let points = first("/points");
    assert_eq!(points[2], serde_json::json!(["x", "y", "weight"]));
    let bytes = points[1].as_u64().unwrap();
    assert!(points[0] == 12 && bytes > 0 && bytes.is_multiple_of(12));
    let work_ms = &first("/latency")["stages"]["pose_integration"]["work_ms"];
    assert!(work_ms.as_f64() > Some(0.0));
    assert!(first("/health")["poses"].as_u64() > Some(0));
    assert_eq!(first("/tf")[0], "odometry");
}

/// The powers of an image of a recording, as the viewer describes them.
fn powers(path: &std::path::Path) -> Value {
    let file = BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let rows = bytes.chunks(info.line_size);
    let powers: Vec<u8> = rows.flat_map(|row| &row[ROW_HEADER..]).copied().collect();
    let digest = Sha256::digest(&powers);
    let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    serde_json::json!([
        "mono8",
        info.width as usize - ROW_HEADER,
        info.height,
        digest
    ])
}

/// Asks for a connection, and returns it with the first line of the answer.
fn connect(url: &str, query: &str, headers: &[&str]) -> (TcpStream, String) {
    let (address, _) = url.strip_prefix("ws://").unwrap().split_once('/').unwrap();
    let (_, port) = address.rsplit_once(':').unwrap();
    let host = format!("Host: 127.0.0.1:{port}");
    let upgrade = [
        &host,
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    ];
    let stream = asked(port, &format!("/{query}"), &[&upgrade, headers].concat());
    let mut answer = String::new();
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    reader.read_line(&mut answer).unwrap();
    (stream, answer.trim().to_owned())
}

const SDK: &str = "Sec-WebSocket-Protocol: foxglove.sdk.v1";
const OLDER: &str = "Sec-WebSocket-Protocol: foxglove.websocket.v1, other";

#[test]
fn viewers_of_other_sites_and_machines_need_the_token() {
    let run = driving("1");
    let (running, open) = started(&run);
    let status = |url: &str, query: &str, headers: &[&str]| {
        let (_, answer) = connect(url, query, headers);
        answer.split(' ').nth(1).unwrap().to_owned()
    };
    let url = open.foxglove();
    for (headers, expected) in [
        (&[SDK][..], "101"),
        (&[OLDER], "101"),
        (&[SDK, "Origin: http://evil.example"], "403"),
        (&["Sec-WebSocket-Protocol: other"], "400"),
        (&[], "400"),
    ] {
        assert_eq!(status(&url, "", headers), expected, "{headers:?}");
    }
    open.interrupt();
    let closed = Server::start(&run, "127.0.0.1", &["--foxglove", "0.0.0.0:0"]);
    assert_eq!(closed.token(), None, "the page stays as it was");
    let url = closed.foxglove();
    let (_, query) = url.split_once("/?").unwrap();
    assert_eq!(status(&url, "", &[SDK]), "401");
    let lichtblick = [SDK, "Origin: http://lichtblick.example"];
    assert_eq!(status(&url, &format!("?{query}"), &lichtblick), "101");
    closed.interrupt();
    running.interrupt();
}

#[test]
fn a_viewer_that_never_reads_costs_neither_memory_nor_the_run() {
    let undisturbed = driving("max").complete();
    let run = driving("12");
    let (mut running, server) = started(&run);
    let (mut stalled, answer) = connect(&server.foxglove(), "", &[SDK]);
    assert!(answer.contains(" 101 "), "{answer}");
    let channels = (0..13).map(|id| serde_json::json!({"id": id, "channelId": id}));
    let channels: Vec<Value> = channels.collect();
    let request = serde_json::json!({"op": "subscribe", "subscriptions": channels});
    stalled.write_all(&frame(&request.to_string())).unwrap();
    running.await_poses(20);
    let own_bytes = || Usage::of(server.pid()).unwrap().own_bytes;
    let early = own_bytes();
    running.await_poses(recording::SCANS_AROUND);
    let late = own_bytes();
    assert_eq!(running.complete(), undisturbed);
    // A hundred scans and rasters are more than twice that.
    assert!(late < early + (16 << 20), "from {early} to {late} bytes");
    server.interrupt();
}

/// A frame of text, masked by zeros.
fn frame(text: &str) -> Vec<u8> {
    let length = (text.len() as u16).to_be_bytes();
    [&[0x81, 0xfe][..], &length, &[0; 4], text.as_bytes()].concat()
}
