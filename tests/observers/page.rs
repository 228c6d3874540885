//! `gyre watch`: the page in a browser, who may read it, and the metrics.

use std::{process::Command, thread, time::Duration};

use crate::{
    common::{Browser, Ended, Run, Server, can, recording},
    live::radar::{Radar, run_at},
    operate::commands::ask,
    reach::only_if,
};

/// A drive that is still going on when a test ends it.
fn long() -> Run {
    small(4000).rate("2")
}

/// A drive of so many scans: the small recording, again and again.
fn small(scans: usize) -> Run {
    let run = Run::of_recording().set("source.repeat=true");
    run.set(&format!("source.scans={scans}"))
}

fn status(answer: &str) -> &str {
    answer.lines().next().unwrap_or_default()
}

#[test]
fn other_machines_need_the_token_and_this_one_none() {
    let run = long();
    let running = run.started(1);
    let server = Server::start(&run, "127.0.0.1", &[]);
    assert_eq!(server.token(), None);
    let page = server.get("/", &[]);
    assert_eq!(status(&page), "HTTP/1.1 200 OK");
    assert!(page.contains("content-security-policy: default-src 'none'; script-src 'self'"));
    for (path, header, expected) in [
        ("/main.js", "Host: localhost", "200"),
        ("/metrics", "Origin: http://rebound.example", "403"),
        ("/../Cargo.toml", "Host: localhost", "404"),
    ] {
        let answer = server.get(path, &[header]);
        assert!(status(&answer).contains(expected), "{path}: {answer}");
    }
    server.interrupt();
    let file = run.folder().join("token");
    let options = ["--token-file", file.to_str().unwrap()];
    let server = Server::start(&run, "0.0.0.0", &options);
    let token = server.token().unwrap().to_owned();
    assert_eq!(std::fs::read_to_string(&file).unwrap().trim(), token);
    for path in ["/", "/main.js", "/metrics", "/stream", "/nothing"] {
        let answer = server.get(path, &[]);
        assert!(status(&answer).contains("401"), "{path}: {answer}");
    }
    let first = server.get(&format!("/?token={token}"), &[]);
    assert!(status(&first).contains("303"), "{first}");
    let mut cookies = first
        .lines()
        .filter_map(|line| line.strip_prefix("set-cookie: "));
    let cookie = cookies.next().unwrap();
    assert!(cookie.contains("HttpOnly; SameSite=Lax"), "{cookie}");
    let cookie = format!("Cookie: {}", cookie.split(';').next().unwrap());
    assert!(status(&server.get("/", &[&cookie])).contains("200"));
    let bearer = format!("Authorization: Bearer {token}");
    assert!(status(&server.get("/metrics", &[&bearer])).contains("200"));
    server.interrupt();
    running.interrupt();
}

#[test]
fn a_folder_without_a_run_is_named_with_how_one_is_started() {
    let run = Run::of_recording();
    let no_run = format!("no run is writing to {}", run.out().display());
    let refused = |end: &str| {
        let sentence = format!("{end}: `gyre run` starts one, and its --out names the folder");
        ask(&run, &["watch", "--listen", "127.0.0.1:0"]).refused_with(&[&no_run, &sentence]);
    };
    let nothing = run.out().display().to_string();
    refused(&nothing);
    std::fs::create_dir(run.out()).unwrap();
    refused(&nothing);
    run.complete();
    refused("the run is complete)");
}

const RESTARTS: &str = "gyre_process_restarts_total{process=\"refinement\"}";
const WORK: &str = "gyre_hop_seconds_count{stage=\"masking\",part=\"work\"}";

#[test]
fn metrics_count_poses_delays_and_restarts() {
    let run = long();
    let mut running = run.started(1);
    let server = Server::start(&run, "127.0.0.1", &[]);
    let value = |metrics: &str, series: &str| -> f64 {
        let line = metrics.lines().find_map(|line| line.strip_prefix(series));
        line.and_then(|value| value.trim().parse().ok())
            .unwrap_or(-1.0)
    };
    running.kill("refinement");
    running.await_poses(12);
    let mut metrics = String::new();
    for _ in 0..600 {
        metrics = server.get("/metrics", &[]);
        if value(&metrics, RESTARTS) >= 1.0 && value(&metrics, "gyre_poses_total") >= 12.0 {
            break;
        }
        thread::sleep(Duration::from_millis(100));
    }
    for (series, least) in [
        ("gyre_up", 1.0),
        ("gyre_poses_total", 12.0),
        (RESTARTS, 1.0),
        ("gyre_sensor_to_pose_seconds_count", 1.0),
        (WORK, 1.0),
        ("gyre_process_memory_bytes{process=\"masking\"}", 1e5),
        ("gyre_scans_dropped_total", 0.0),
    ] {
        assert!(value(&metrics, series) >= least, "{series}:\n{metrics}");
    }
    assert!(metrics.contains("content-type: application/openmetrics-text"));
    assert!(metrics.trim_end().ends_with("# EOF"), "{metrics}");
    running.interrupt();
    server.interrupt();
}

/// The rules of the alerts, where a folder with the files of Prometheus is.
const RULES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/prometheus");

#[test]
fn a_run_of_a_live_radar_has_all_metrics_of_the_alerts() {
    // At another pace there is no clock to compare.
    let radar = Radar::playing(recording::small(), &["--repeat", "--rate", "1"]);
    let run = run_at(&radar.address);
    let running = run.started(6);
    let server = Server::start(&run, "127.0.0.1", &[]);
    let mut metrics = String::new();
    while !metrics.contains("\ngyre_radar_clock_steps_total 0") {
        thread::sleep(Duration::from_millis(100));
        metrics = server.get("/metrics", &[]);
    }
    let rules = std::fs::read_to_string(format!("{RULES}/gyre.rules.yml")).unwrap();
    let words = rules.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':');
    for name in words.filter(|word| word.starts_with("gyre_")) {
        let has = |line: &str| {
            line.strip_prefix(name)
                .is_some_and(|it| it.starts_with([' ', '{']))
        };
        assert!(metrics.lines().any(has), "{name}: {metrics}");
    }
    running.interrupt();
    server.interrupt();
}

#[test]
fn each_alert_fires_on_the_series_of_its_fault_and_none_on_those_of_a_healthy_run() {
    only_if!(can(&["promtool", "--version"]));
    let mut promtool = Command::new("promtool");
    promtool
        .args(["test", "rules", "gyre.rules.test.yml"])
        .current_dir(RULES);
    let ended = Ended::of(promtool);
    assert!(ended.status.success(), "{ended:?}");
}

const POSES: &str = "Number(document.getElementById('poses').textContent)";

#[test]
fn the_page_shows_poses_a_killed_stage_and_the_end_of_each_run() {
    let Some(mut browser) = Browser::start() else {
        return;
    };
    let run = long();
    let mut running = run.started(1);
    let server = Server::start(&run, "127.0.0.1", &[]);
    browser.resize(1440, 900, false).go_to(&server.address);
    browser.until("document.getElementById('state').textContent === 'Running'");
    browser.until(&format!("{POSES} > 3"));
    browser.until("document.getElementById('scan-caption').textContent.startsWith('Scan ')");
    shows_what_can_be_told_apart(&mut browser);
    browser.until("document.querySelectorAll('#stages tr').length === 6");
    running.kill("masking");
    let restarted = "[...document.querySelectorAll('#processes tr')].some(row => row.cells[0].textContent === 'masking' && Number(row.cells[2].textContent) > 0)";
    browser.until(restarted);
    let poses = browser.evaluate(POSES).as_f64().unwrap();
    browser.until(&format!("{POSES} > {}", poses + 4.0));
    fits_a_phone(&mut browser);
    running.interrupt();
    browser.until("document.getElementById('state').textContent === 'Ended early'");
    let banner = browser.text("banner");
    assert!(banner.contains("The same command continues it"));

    // The next run in the same folder is shown, and the browser changes no result.
    let short = small(40).option("--fresh");
    let undisturbed = short.complete();
    let watched = short.clone().into(run.out());
    running = watched.start();
    running.await_poses(40);
    running.finish().succeeded();
    browser.until("document.getElementById('state').textContent === 'Ended: complete'");
    browser.until(&format!("{POSES} === 40"));
    assert_eq!(watched.odometry(), undisturbed);
    assert_eq!(browser.errors, [""; 0]);
    server.interrupt();
    browser.until("document.getElementById('state').textContent === 'Connection lost'");
}

/// Asserts that the caption contains the selected range, that points and objects have different
/// colours, and that labels at one place are written one above the other.
fn shows_what_can_be_told_apart(browser: &mut Browser) {
    browser.evaluate("range.value = '25', range.dispatchEvent(new Event('change'))");
    browser.until("document.getElementById('scan-caption').textContent.includes('to 25 m,')");
    let distinct = "import('/canvas.js').then(({ Labels, colour }) => {
        const lines = new Set(), labels = new Labels(), fillText = (_, x, y) => lines.add(y);
        const context = { measureText: () => ({ width: 30 }), strokeText() {}, fillText };
        for (let k = 0; k < 9; k += 1) labels.write(context, '', 20 + 3 * k, 90);
        return [lines.size, new Set(['points', 'object', 'accent'].map(colour)).size];
    })";
    assert_eq!(browser.evaluate(distinct), serde_json::json!([9, 3]));
}

/// Asserts that nothing is wider than a phone, and that nothing has moved since the page was
/// opened.
fn fits_a_phone(browser: &mut Browser) {
    let moved = "new Promise((done) => {
        let moved = 0;
        new PerformanceObserver((list) => list.getEntries().forEach((entry) => { moved += entry.value; }))
            .observe({ type: 'layout-shift', buffered: true });
        setTimeout(() => done(moved), 300);
    })";
    let moved = browser.evaluate(moved).as_f64().unwrap();
    assert!(moved < 0.1, "the layout has moved by {moved}");
    browser.resize(390, 844, true);
    browser.until("document.documentElement.clientWidth === 390");
    let width = browser.evaluate("document.documentElement.scrollWidth");
    assert_eq!(width.as_u64(), Some(390));
}
