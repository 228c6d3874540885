//! `report.md`.

use std::fmt::Write;

use super::{Figures, Outcome, Provenance, Report, Verdict};
use crate::{
    copying::Row,
    memory::Taken,
    record::{Counts, Distribution},
    scenario::Scenario,
};

/// A cell without a figure.
const NONE: &str = "-";

/// Returns the page.
pub fn page(report: &Report) -> String {
    let mut page = String::new();
    head(&mut page, &report.provenance);
    verdicts(&mut page, &report.outcomes);
    overview(&mut page, &report.outcomes);
    for outcome in &report.outcomes {
        section(&mut page, outcome);
    }
    page
}

fn head(page: &mut String, provenance: &Provenance) {
    let Provenance {
        date,
        machine,
        kernel,
        gyre,
        build,
        configuration,
        source,
        load_before,
    } = provenance;
    let build = build.get(..12).unwrap_or(build);
    let load = load_before.map_or("unknown".to_owned(), |load| format!("{load:.2}"));
    let _ = writeln!(
        page,
        "# Stress of {configuration}\n\n\
         | | |\n|---|---|\n\
         | date | {date} |\n| machine | {machine}, Linux {kernel} |\n| load before, processes | {load} |\n\
         | gyre | {gyre}, build {build} |\n| configuration | {configuration}, resolved in `config.toml` |\n| source | {source} |"
    );
}

fn verdicts(page: &mut String, outcomes: &[Outcome]) {
    let with = |verdict| outcomes.iter().filter(move |it| it.verdict == verdict);
    let (failed, passed) = (with(Verdict::Failed).count(), with(Verdict::Passed).count());
    let (open, judged) = (with(Verdict::NotCarriedOut).count(), failed + passed);
    let _ = match (failed, judged) {
        (_, 0) if open > 0 => writeln!(page, "\n**Not judged**."),
        (_, 0) => writeln!(
            page,
            "\n**Not judged**: the configuration has no section `[budget]` with limits for these scenarios."
        ),
        (0, _) => writeln!(
            page,
            "\n**Passed**: {judged} of {judged} scenarios that are judged."
        ),
        _ => writeln!(
            page,
            "\n**FAILED**: {failed} of {judged} scenarios that are judged."
        ),
    };
    if open > 0 {
        let _ = writeln!(page, "\n**NOT CARRIED OUT**: {open} of {}.", outcomes.len());
    }
    let mut checks = outcomes
        .iter()
        .flat_map(|outcome| outcome.checks.iter().map(move |check| (outcome, check)))
        .peekable();
    if checks.peek().is_some() {
        page.push_str("\n| scenario | limit | measured | |\n|---|---|---|---|\n");
    }
    for (outcome, check) in checks {
        let measured = check
            .measured
            .map_or(NONE.to_owned(), |it| format!("{it:.1}"));
        let passed = if check.passed { "kept" } else { "**not kept**" };
        let (scenario, key, limit) = (outcome.scenario, check.key, check.limit);
        let _ = writeln!(
            page,
            "| {scenario} | `{key}` {limit} | {measured} | {passed} |"
        );
    }
    for outcome in outcomes {
        if let Some(problem) = &outcome.problem {
            let _ = writeln!(page, "\n**{}**: {problem}.", outcome.scenario);
        }
    }
}

/// A table of all scenarios that have a latency.
fn overview(page: &mut String, outcomes: &[Outcome]) {
    let mut measured = outcomes
        .iter()
        .filter_map(|outcome| Some((outcome, outcome.figures.as_ref()?)))
        .filter(|(_, figures)| figures.counts.due > 0)
        .peekable();
    if measured.peek().is_none() {
        return;
    }
    page.push_str(
        "\n## Sensor to pose\n\n![latency by percentile](report.svg)\n\n\
         Time from the moment at which a scan was due by the sensor's clock to its pose, ms. A scan that was dropped counts until the pose \
         that replaced it. In the last columns is what a closed loop would have said of the same run: from the publication of a scan to its \
         pose, of the scans that have one. `-`: too few samples for that percentile. `of N`: fewer than ten of its N samples are beyond it, so that it \
         depends on the luck of few scans.\n\n\
         | scenario | scans/s | due | dropped | p50 | p90 | p99 | p99.9 | p99.99 | max | closed loop p50 | p99 | max |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (outcome, figures) in measured {
        let Counts { due, dropped, .. } = figures.counts;
        let closed = &figures.closed_loop;
        let _ = writeln!(
            page,
            "| {} | {} | {due} | {dropped} | {} | {} | {} | {} |",
            outcome.scenario,
            outcome.rate_hz,
            percentiles(&figures.sensor_to_pose),
            ms(closed.p50_ms),
            ms(closed.p99_ms) + &closed.mark(closed.p99_ms, 0.99),
            ms(closed.max_ms)
        );
    }
}

fn section(page: &mut String, outcome: &Outcome) {
    let Outcome {
        scenario,
        line,
        duration_s,
        ..
    } = outcome;
    let _ = writeln!(
        page,
        "\n## {scenario}\n\n{}{}. {duration_s:.0} s.",
        line[..1].to_uppercase(),
        &line[1..]
    );
    if let Some(figures) = &outcome.figures {
        if !figures.timeline.is_empty() {
            let _ = writeln!(page, "\n![latency over time]({scenario}.svg)");
        }
        counts(page, figures);
        hops(page, figures);
        faults(page, figures);
        processes(page, figures);
    }
    steps(page, outcome);
    copying(page, &outcome.copying);
}

fn counts(page: &mut String, figures: &Figures) {
    let Counts {
        due,
        posed,
        dropped,
        never,
        unseen: _,
    } = figures.counts;
    if due == 0 {
        return;
    }
    let late: u64 = figures.wakes_caught_late.values().sum();
    let restarts: usize = figures.restarts.values().sum();
    let _ = writeln!(
        page,
        "\n{due} scans were due: {posed} have a pose, {dropped} were dropped ({:.2} %), {never} of them without any later pose. {restarts} restarts. \
         {late} wake-ups were caught late.",
        figures.drops_percent().unwrap_or(0.0),
    );
}

fn hops(page: &mut String, figures: &Figures) {
    if figures.hops.is_empty() {
        return;
    }
    page.push_str(
        "\nHop by hop, of the scans with a pose, ms: *transport* from the publication by the stage before to the reception, *wait* until the work \
         begins, *work*.\n\n\
         | hop | samples | p50 | p90 | p99 | p99.9 | p99.99 | max |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut row = |name: &str, latency: &Distribution| {
        let _ = writeln!(
            page,
            "| {name} | {} | {} |",
            latency.samples,
            percentiles(latency)
        );
    };
    for hop in &figures.hops {
        if let Some(transport) = &hop.transport {
            row(&format!("transport to {}", hop.stage), transport);
        }
        row(&format!("{}, wait", hop.stage), &hop.wait);
        row(&format!("{}, work", hop.stage), &hop.work);
    }
    row("sensor to pose, scans with a pose", &figures.posed);
}

fn faults(page: &mut String, figures: &Figures) {
    if figures.faults.is_empty() {
        return;
    }
    page.push_str("\n| at, s | fault | stage | recovered after, ms |\n|---|---|---|---|\n");
    for fault in &figures.faults {
        let kind = match fault.kind {
            crate::fault::FaultKind::Stop => "stopped for 1 s",
            crate::fault::FaultKind::Kill => "killed",
        };
        let (at_s, stage) = (fault.at_s, fault.stage);
        let recovery = fault
            .recovery_ms
            .map_or("never".to_owned(), |ms| format!("{ms:.1}"));
        let _ = writeln!(page, "| {at_s:.2} | {kind} | {stage} | {recovery} |");
    }
    page.push_str(
        "\nRecovered: from the kill, or from the end of the stop, to the first pose that the stage has worked on since; the wait for the next scan \
         is part of it.\n",
    );
}

fn processes(page: &mut String, figures: &Figures) {
    if figures.processes.is_empty() {
        return;
    }
    page.push_str(
        "\n| process | processor, % of one | own memory, MB | wake-ups/s | taken off a processor/s |\n|---|---|---|---|---|\n",
    );
    for cost in &figures.processes {
        let name = match cost.processes {
            1 => cost.name.clone(),
            processes => format!("{} ({processes} processes)", cost.name),
        };
        let _ = writeln!(
            page,
            "| {name} | {:.2} | {:.1} | {:.1} | {:.1} |",
            cost.cpu_percent, cost.own_mb, cost.wake_ups_per_s, cost.preemptions_per_s
        );
    }
    let sum =
        |of: fn(&crate::processes::Cost) -> f64| figures.processes.iter().map(of).sum::<f64>();
    let _ = writeln!(
        page,
        "| all | {:.2} | {:.1} | {:.1} | {:.1} |\n\nShared memory: {:.1} MB.",
        figures.cpu_percent(),
        sum(|cost| cost.own_mb),
        sum(|cost| cost.wake_ups_per_s),
        sum(|cost| cost.preemptions_per_s),
        figures.shared_bytes as f64 * 1e-6
    );
    if let Some(Taken {
        taken_mb,
        available_mb,
    }) = figures.taken
    {
        let _ = writeln!(
            page,
            "\nTaken beside it: {taken_mb:.0} MB of the {available_mb:.0} MB that were available."
        );
    }
}

fn steps(page: &mut String, outcome: &Outcome) {
    if outcome.steps.is_empty() {
        return;
    }
    let level = |level: Option<f64>| level.map_or("none".to_owned(), |level| format!("{level:.1}"));
    let (found, failed) = (level(outcome.best), level(outcome.failed));
    let (what, unit) = match outcome.scenario {
        Scenario::Ramp => ("The highest rate that passed, scans/s", "scans/s"),
        _ => ("The largest number of 4 Hz radars that passed", "radars"),
    };
    let _ = writeln!(
        page,
        "\n{what}: **{found}**. The lowest above it that failed, twice: {failed}.\n\n| {unit} | due | dropped | p50, ms | p99, ms | processor, % of one | |\n|---|---|---|---|---|---|---|"
    );
    for step in &outcome.steps {
        let _ = writeln!(
            page,
            "| {:.1} | {} | {} | {} | {} | {:.1} | {} |",
            step.level,
            step.due,
            step.dropped,
            ms(step.p50_ms),
            ms(step.p99_ms),
            step.cpu_percent,
            step.reason.as_deref().unwrap_or("passed")
        );
    }
}

fn copying(page: &mut String, rows: &[Row]) {
    if rows.is_empty() {
        return;
    }
    page.push_str(
        "\nFrom the start of the sending until the last reader has the message, ms; processor time of the sender (without the time to write the \
         message) and of a reader for a message, us. Both ways: one process for the sender and one for each reader, 50 messages/s, readers that sleep in \
         `ppoll` and read a byte of each cache line.\n\n\
         | message | bytes | readers | way | p50 | p99 | max | sender, us | a reader, us | own memory, MB | shared memory, MB | missed |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let latency = &row.to_last_reader;
        let fine = |ms: Option<f64>| ms.map_or(NONE.to_owned(), |ms| format!("{ms:.3}"));
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {} |",
            row.topic,
            row.bytes,
            row.readers,
            row.way.name(),
            fine(latency.p50_ms),
            fine(latency.p99_ms),
            fine(latency.max_ms),
            row.sender_us,
            row.reader_us,
            row.own_mb,
            row.shared_mb,
            row.missed
        );
    }
}

fn percentiles(latency: &Distribution) -> String {
    let shares = [
        (latency.p50_ms, 0.5),
        (latency.p90_ms, 0.9),
        (latency.p99_ms, 0.99),
        (latency.p99_9_ms, 0.999),
        (latency.p99_99_ms, 0.9999),
    ];
    let cells = shares.map(|(percentile, share)| ms(percentile) + &latency.mark(percentile, share));
    format!("{} | {}", cells.join(" | "), ms(latency.max_ms))
}

/// Three digits, and no more than three after the point: clocks are not finer.
fn ms(ms: Option<f64>) -> String {
    match ms {
        None => NONE.to_owned(),
        Some(ms) if ms >= 100.0 => format!("{ms:.0}"),
        Some(ms) if ms >= 10.0 => format!("{ms:.1}"),
        Some(ms) if ms >= 1.0 => format!("{ms:.2}"),
        Some(ms) => format!("{ms:.3}"),
    }
}
