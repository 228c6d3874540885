//! `gyre watch --otlp`: a collector receives a trace of each pose, and one that is away costs
//! nothing.

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{BufRead, BufReader, Read, Write},
    net::{TcpListener, TcpStream},
    sync::mpsc::{self, Sender},
    thread,
    time::Duration,
};

use rustix::process::Signal;
use serde_json::Value;

use crate::common::{Ended, Run, Server, gyre, odometry, recording};

fn driving(rate: &str) -> Run {
    let data = recording::around_a_block().to_str().unwrap();
    Run::small().argument("--data", data).rate(rate)
}

/// Answers requests on a connection, and passes on what they hold.
fn collect(connection: &TcpStream, requests: &Sender<(String, Value)>) -> Option<()> {
    let mut reader = BufReader::new(connection);
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok().filter(|read| *read > 0)?;
        let mut length = 0;
        loop {
            let mut header = String::new();
            reader.read_line(&mut header).ok()?;
            let header = header.trim().to_lowercase();
            if header.is_empty() {
                break;
            }
            if let Some(bytes) = header.strip_prefix("content-length: ") {
                length = bytes.parse().ok()?;
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).ok()?;
        requests
            .send((line.trim().to_owned(), serde_json::from_slice(&body).ok()?))
            .ok()?;
        let answer =
            "HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}";
        (&mut &*connection).write_all(answer.as_bytes()).ok()?;
    }
}

/// The spans of a request.
fn spans(request: &Value) -> &Vec<Value> {
    request["resourceSpans"][0]["scopeSpans"][0]["spans"]
        .as_array()
        .unwrap()
}

fn number(span: &Value, key: &str) -> i64 {
    span[key].as_str().unwrap().parse().unwrap()
}

fn attribute(span: &Value, key: &str) -> i64 {
    let mut attributes = span["attributes"].as_array().unwrap().iter();
    let found = attributes.find(|it| it["key"] == key).unwrap();
    number(&found["value"], "intValue")
}

#[test]
fn a_collector_receives_a_trace_of_each_pose_with_the_spans_of_all_stages() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let (sender, requests) = mpsc::channel();
    thread::spawn(move || {
        listener
            .incoming()
            .map_while(Result::ok)
            .for_each(|connection| {
                let sender = sender.clone();
                thread::spawn(move || collect(&connection, &sender));
            });
    });
    let run = driving("4");
    let mut running = run.start();
    running.await_poses(1);
    let server = Server::start(&run, "127.0.0.1", &["--otlp", &url]);
    running.finish().succeeded();
    // It sends what is left when it ends.
    let said = server.address.clone();
    server.interrupt();
    let requests: Vec<_> =
        std::iter::from_fn(|| requests.recv_timeout(Duration::ZERO).ok()).collect();
    assert!(!requests.is_empty(), "{said}");
    let mut traces: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for (line, request) in &requests {
        assert_eq!(line, "POST /v1/traces HTTP/1.1");
        for span in spans(request) {
            traces
                .entry(span["traceId"].as_str().unwrap())
                .or_default()
                .push(span);
        }
    }
    let csv = run.odometry();
    let rows = odometry::rows(&csv);
    let scans: BTreeMap<u64, u64> = rows.iter().map(|row| (row.seq, row.scan)).collect();
    let mut seqs = BTreeSet::new();
    for spans in traces.values() {
        let (roots, parts): (Vec<&&Value>, Vec<&&Value>) = spans
            .iter()
            .partition(|span| span.get("parentSpanId").is_none());
        assert_eq!(
            (roots.len(), &roots[0]["name"]),
            (1, &"sensor to pose".into())
        );
        let seq = attribute(roots[0], "gyre.seq") as u64;
        assert!(seqs.insert(seq), "{seq} has two traces");
        if seq > 0 {
            assert_eq!(attribute(roots[0], "gyre.scan") as u64, scans[&seq]);
        }
        assert_eq!(attribute(roots[0], "gyre.dropped"), 0);
        let of_root = parts
            .iter()
            .filter(|it| it["parentSpanId"] == roots[0]["spanId"]);
        let stages: Vec<_> = of_root.map(|it| it["name"].as_str().unwrap()).collect();
        let expected = [
            "radar-replay",
            "masking",
            "rotation-search",
            "translation-search",
            "refinement",
            "pose-integration",
        ];
        assert_eq!(stages, expected);
        for span in spans {
            let [start, end] =
                ["startTimeUnixNano", "endTimeUnixNano"].map(|key| number(span, key));
            assert!(start <= end && end > 1_600_000_000_000_000_000, "{span}");
        }
    }
    // Those from when it looked on the last one; what it has missed is counted by /metrics.
    let first = *seqs.first().unwrap();
    let last = recording::SCANS_AROUND as u64 - 1;
    assert_eq!(seqs, (first..=last).collect());
    assert!(first < last / 2, "{first}");
}

#[test]
fn a_collector_that_is_away_is_said_and_counted_and_the_run_is_the_same() {
    let undisturbed = driving("max").complete();
    // Others take their ports on 127.0.0.1, so that nobody listens at this one.
    let free = TcpListener::bind("127.0.0.2:0").unwrap();
    let url = format!("http://{}", free.local_addr().unwrap());
    drop(free);
    let run = driving("12");
    let mut running = run.start();
    running.await_poses(1);
    let server = Server::start(&run, "127.0.0.1", &["--otlp", &url]);
    assert!(server.line("traces do not reach ").starts_with(&url));
    running.finish().succeeded();
    let metrics = server.get("/metrics", &[]);
    let dropped = metrics
        .lines()
        .find_map(|line| line.strip_prefix("gyre_traces_dropped_total "));
    assert!(
        dropped.is_some_and(|count| count.parse::<u64>().unwrap() > 0),
        "{metrics}"
    );
    assert_eq!(run.odometry(), undisturbed);
    server.interrupt();
}

#[test]
fn an_address_that_is_none_of_a_collector_is_refused() {
    let run = driving("2");
    let mut running = run.start();
    running.await_poses(1);
    for (url, words) in [
        ("robot:4318", "no address of a collector"),
        ("https://robot:4318", "needs TLS"),
    ] {
        let mut command = gyre();
        command
            .arg("watch")
            .arg(run.out())
            .args(["--listen", "127.0.0.1:0", "--otlp", url]);
        Ended::of(command).refused_with(&[url, words]);
    }
    running.signal(Signal::TERM);
    assert_eq!(running.finish().code(), Some(130));
}
