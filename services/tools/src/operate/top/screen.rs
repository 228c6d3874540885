//! A snapshot at a run as a screen, or as text.

use gyre_configuration::terminal::wrap;
use gyre_contract::{
    control::{Activity, ProcessStatus, SensorClock},
    run::latency::HopLatency,
};
use ratatui::{
    Frame,
    layout::{Constraint, Layout, Rect},
    style::{Color, Style, Stylize},
    text::{Line, Text},
    widgets::{Block, Paragraph, Sparkline},
};

use super::{Snapshot, Use};
use crate::operate::processes::{duration, lacks, summary};

const COLUMNS: [(&str, u16); 12] = [
    ("process", 19),
    ("pid", 8),
    ("state", 8),
    ("for", 7),
    ("cpu", 6),
    ("work p50", 9),
    ("p99", 9),
    ("hop p50", 8),
    ("p99", 8),
    ("memory", 7),
    ("wakes/s", 8),
    ("restarts", 8),
];

/// The columns that are left out where the screen is too narrow for all, the first one first.
const LEFT_OUT: [usize; 5] = [10, 8, 1, 9, 3];

/// Returns the places of the columns that fit into this width, each whole.
fn columns(width: u16) -> Vec<usize> {
    let mut shown: Vec<usize> = (0..COLUMNS.len()).collect();
    let needed = |shown: &[usize]| shown.iter().map(|it| COLUMNS[*it].1 + 1).sum::<u16>() - 1;
    for column in LEFT_OUT {
        if needed(&shown) > width {
            shown.retain(|it| *it != column);
        }
    }
    shown
}

pub fn draw(frame: &mut Frame<'_>, snapshot: &Snapshot) {
    let width = frame.area().width;
    let (lines, rows) = (
        head_lines(snapshot, width),
        rows(snapshot, width.saturating_sub(2)),
    );
    let [head, latency, table, foot] = Layout::vertical([
        Constraint::Length(lines.len() as u16),
        Constraint::Max(12),
        Constraint::Length(rows.len() as u16 + 2),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let mut title: Vec<Line<'_>> = lines.into_iter().map(Line::from).collect();
    title[0] = title[0].clone().bold();
    frame.render_widget(Text::from(title), head);
    draw_latency(frame, snapshot, latency);
    let block = Block::bordered().title(" processes ");
    frame.render_widget(Paragraph::new(rows).block(block), table);
    frame.render_widget(Line::from(" q quit").dim(), foot);
}

fn draw_latency(frame: &mut Frame<'_>, snapshot: &Snapshot, area: Rect) {
    let longest = snapshot.history.iter().max().copied().unwrap_or_default();
    let most = duration(longest as f64 * 1e-6);
    let title = format!(" sensor to pose: the longest of each snapshot, up to {most} ");
    let block = Block::bordered().title(title);
    let width = usize::from(block.inner(area).width);
    let first = snapshot.history.len().saturating_sub(width);
    let sparkline = Sparkline::default()
        .block(block)
        .data(&snapshot.history[first..])
        .style(Style::new().fg(Color::Cyan));
    frame.render_widget(sparkline, area);
}

/// Returns a snapshot as text of this width at most, as far as its columns can be left out.
pub fn text(snapshot: &Snapshot, width: u16) -> String {
    let mut lines = head_lines(snapshot, width);
    lines.extend(rows(snapshot, width).iter().map(Line::to_string));
    lines.join("\n")
}

/// Returns the table of the processes, row by row.
fn rows(snapshot: &Snapshot, width: u16) -> Vec<Line<'static>> {
    let shown = columns(width);
    let row = |cells: [String; COLUMNS.len()]| {
        let cell = |it: &usize| format!("{:width$}", cells[*it], width = COLUMNS[*it].1.into());
        let cells: Vec<String> = shown.iter().map(cell).collect();
        cells.join(" ").trim_end().to_owned()
    };
    let titles = row(COLUMNS.map(|(title, _)| title.to_owned()));
    let mut rows = vec![Line::from(titles).bold()];
    for (process, used) in snapshot.status.processes.iter().zip(&snapshot.processes) {
        let style = match process.activity {
            Activity::Silent | Activity::Ended => Style::new().fg(Color::Red),
            Activity::Starting => Style::new().fg(Color::Yellow),
            _ if process.restarts > 0 => Style::new().fg(Color::Yellow),
            _ => Style::new(),
        };
        rows.push(Line::styled(row(cells(snapshot, process, used)), style));
    }
    rows
}

fn head_lines(snapshot: &Snapshot, width: u16) -> Vec<String> {
    let status = &snapshot.status;
    let in_flight = snapshot.in_flight.map(|count| count.to_string());
    let in_flight = in_flight.as_deref().unwrap_or("unknown");
    let received = status
        .processes
        .iter()
        .filter_map(|it| it.received.as_ref());
    let lacks: String = received.clone().map(lacks).collect();
    let clock: String = received
        .filter_map(|it| it.clock.as_ref())
        .map(clock)
        .collect();
    let missed: u64 = status.processes.iter().filter_map(|it| it.missed).sum();
    let missed = match missed {
        0 => String::new(),
        missed => format!(", {missed} messages missed by the recorder"),
    };
    let latency = &snapshot.latency.sensor_to_pose;
    let [p50, p99, max] = [latency.p50_us, latency.p99_us, latency.max_us].map(us);
    let (rate, scans) = (snapshot.rate, snapshot.latency.scans);
    let lines = [
        status.out.display().to_string(),
        summary(status),
        format!("{rate:.1} scans/s, {in_flight} in flight{missed}{lacks}{clock}"),
        format!("sensor to pose p50 {p50}, p99 {p99}, max {max} of {scans} poses in 10 s"),
        witnesses(snapshot),
    ];
    wrap(&lines.join("\n"), width.into())
}

/// Returns the clock of the radar against this host's, in words.
fn clock(clock: &SensorClock) -> String {
    let sign = if clock.offset_ns > 0 {
        "behind"
    } else {
        "ahead"
    };
    let seconds = |ns: i64| duration(ns.unsigned_abs() as f64 * 1e-9);
    let (offset, jitter) = (seconds(clock.offset_ns), seconds(clock.jitter_ns));
    let steps = match clock.steps {
        0 => String::new(),
        1 => ", set once".to_owned(),
        steps => format!(", set {steps} times"),
    };
    format!("  radar's clock {offset} {sign}, jitter {jitter}{steps}")
}

/// Returns the basis of the newest motion, how often gyro, wheels and Doppler were used, and the
/// rates of their samples.
fn witnesses(snapshot: &Snapshot) -> String {
    let basis = snapshot.basis.unwrap_or("no motion");
    let motions = snapshot.witnesses.motions();
    let used = snapshot.witnesses.in_words();
    let used = used.map(|used| format!("{used} of {motions} motions in 10 s"));
    let words: Vec<String> = used.into_iter().chain(snapshot.samples.clone()).collect();
    match words.as_slice() {
        [] => basis.to_owned(),
        words => format!("{basis}: {}", words.join("; ")),
    }
}

fn cells(snapshot: &Snapshot, process: &ProcessStatus, used: &Use) -> [String; COLUMNS.len()] {
    let latency = snapshot.latency.stages.get(process.name.as_str());
    let of = |value: fn(&HopLatency) -> Option<f64>| latency.and_then(value).map(us);
    [
        process.name.clone(),
        process.pid.to_string(),
        process.activity.name().to_owned(),
        process.activity_s.map(duration).unwrap_or_default(),
        format!("{:.1} %", 100.0 * used.cpu),
        of(|it| Some(it.work.p50_us)).unwrap_or_default(),
        of(|it| Some(it.work.p99_us)).unwrap_or_default(),
        of(|it| Some(it.transport?.p50_us)).unwrap_or_default(),
        of(|it| Some(it.transport?.p99_us)).unwrap_or_default(),
        format!("{:.0} MB", used.own_bytes as f64 * 1e-6),
        format!("{:.0}", used.wake_ups),
        process.restarts.to_string(),
    ]
}

fn us(us: f64) -> String {
    match us {
        us if us < 999.5 => format!("{us:.0} us"),
        us if us < 9_995.0 => format!("{:.2} ms", us * 1e-3),
        us if us < 99_950.0 => format!("{:.1} ms", us * 1e-3),
        us => duration(us * 1e-6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_whole_on_a_small_screen_and_all_there_on_a_wide_one() {
        let titles =
            |width: u16| -> Vec<&str> { columns(width).iter().map(|it| COLUMNS[*it].0).collect() };
        let expected = [
            "process", "state", "cpu", "work p50", "p99", "hop p50", "restarts",
        ];
        assert_eq!(titles(78), expected);
        assert_eq!(titles(116).len(), COLUMNS.len());
        assert_eq!(titles(115).len(), COLUMNS.len() - 1);
    }
}
