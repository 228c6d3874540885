//! `report.md`.

use gyre_messages::{Basis, WitnessCounts};
use gyre_run::Scenario;

use super::{Figures, Provenance, Report, ScenarioOutcome, Verdict};
use crate::{
    copying::HandOverCost,
    fault::FaultKind,
    memory::Taken,
    processes::Cost,
    record::{Counts, Distribution},
};

/// A cell without a figure.
const NONE: &str = "-";

/// Returns the page.
pub fn page(report: &Report) -> String {
    let outcomes = &report.outcomes;
    let parts = [
        head(&report.provenance),
        verdicts(outcomes),
        overview(outcomes),
    ];
    let sections = outcomes.iter().map(section);
    parts.into_iter().chain(sections).collect()
}

/// Returns a table after its introduction; nothing without rows. Cells are separated by ` | `.
fn table(introduction: &str, columns: &str, rows: impl Iterator<Item = String>) -> String {
    let rows: String = rows.map(|row| format!("| {row} |\n")).collect();
    if rows.is_empty() {
        return rows;
    }
    let rule = "---|".repeat(columns.split('|').count());
    format!("\n{introduction}| {columns} |\n|{rule}\n{rows}")
}

fn head(provenance: &Provenance) -> String {
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
    format!(
        "# Stress of {configuration}\n\n\
         | | |\n|---|---|\n\
         | date | {date} |\n| machine | {machine}, Linux {kernel} |\n| load before, processes | {load} |\n\
         | gyre | {gyre}, build {build} |\n| configuration | {configuration}, resolved in `config.toml` |\n| source | {source} |\n"
    )
}

fn verdicts(outcomes: &[ScenarioOutcome]) -> String {
    let with = |verdict| outcomes.iter().filter(|it| it.verdict == verdict).count();
    let (failed, passed) = (with(Verdict::Failed), with(Verdict::Passed));
    let (open, judged) = (with(Verdict::NotCarriedOut), failed + passed);
    let mut text = match (failed, judged) {
        (_, 0) if open > 0 => "\n**Not judged**.\n".to_owned(),
        (_, 0) => "\n**Not judged**: the configuration has no section `[budget]` with limits for these scenarios.\n".to_owned(),
        (0, _) => format!("\n**Passed**: {judged} of {judged} scenarios that are judged.\n"),
        _ => format!("\n**FAILED**: {failed} of {judged} scenarios that are judged.\n"),
    };
    if open > 0 {
        text += &format!("\n**NOT CARRIED OUT**: {open} of {}.\n", outcomes.len());
    }
    let checks = outcomes.iter().flat_map(|outcome| {
        outcome.checks.iter().map(move |check| {
            let measured = check
                .measured
                .map_or(NONE.to_owned(), |it| format!("{it:.1}"));
            let passed = if check.passed { "kept" } else { "**not kept**" };
            let (scenario, key, limit) = (outcome.scenario, check.key, check.limit);
            format!("{scenario} | `{key}` {limit} | {measured} | {passed}")
        })
    });
    text += &table("", "scenario | limit | measured |", checks);
    for outcome in outcomes {
        if let Some(problem) = &outcome.problem {
            text += &format!("\n**{}**: {problem}.\n", outcome.scenario);
        }
    }
    text
}

/// Returns a table of all scenarios that have a latency.
fn overview(outcomes: &[ScenarioOutcome]) -> String {
    let measured = outcomes
        .iter()
        .filter_map(|outcome| Some((outcome, &outcome.figures.as_ref()?.latency)))
        .filter(|(_, latency)| latency.counts.due > 0);
    let rows = measured.map(|(outcome, latency)| {
        let Counts { due, dropped, .. } = latency.counts;
        let closed = &latency.closed_loop;
        format!(
            "{} | {} | {due} | {dropped} | {} | {} | {} | {}",
            outcome.scenario,
            outcome.rate_hz,
            percentiles(&latency.sensor_to_pose),
            ms(closed.p50_ms),
            ms(closed.p99_ms) + &closed.mark(closed.p99_ms, 0.99),
            ms(closed.max_ms)
        )
    });
    table(
        "## Sensor to pose\n\n![latency by percentile](report.svg)\n\n\
         Time from the moment at which a scan was due by the sensor's clock to its pose, ms. A scan that was dropped counts until the pose \
         that replaced it. In the last columns is what a closed loop would have said of the same run: from the publication of a scan to its \
         pose, of the scans that have one. `-`: too few samples for that percentile. `of N`: fewer than ten of its N samples are beyond it, so that it \
         depends on the luck of few scans.\n\n",
        "scenario | scans/s | due | dropped | p50 | p90 | p99 | p99.9 | p99.99 | max | closed loop p50 | p99 | max",
        rows,
    )
}

fn section(outcome: &ScenarioOutcome) -> String {
    let ScenarioOutcome {
        scenario,
        line,
        duration_s,
        ..
    } = outcome;
    let (first, rest) = (line[..1].to_uppercase(), &line[1..]);
    let mut text = format!("\n## {scenario}\n\n{first}{rest}. {duration_s:.0} s.\n");
    if let Some(figures) = &outcome.figures {
        if !figures.latency.timeline.is_empty() {
            text += &format!("\n![latency over time]({scenario}.svg)\n");
        }
        text += &counts(figures);
        text += &hops(figures);
        text += &faults(figures);
        text += &witness_faults(figures);
        text += &processes(figures);
    }
    text + &steps(outcome) + &copying(&outcome.copying)
}

fn counts(figures: &Figures) -> String {
    let Counts {
        due,
        posed,
        dropped,
        never,
        unseen: _,
    } = figures.latency.counts;
    if due == 0 {
        return String::new();
    }
    let late: u64 = figures.wakes_caught_late.values().sum();
    let restarts: usize = figures.restarts.values().sum();
    format!(
        "\n{due} scans were due: {posed} have a pose, {dropped} were dropped ({:.2} %), {never} of them without any later pose. {restarts} restarts. \
         {late} wake-ups were caught late.\n",
        figures.drops_percent().unwrap_or(0.0),
    )
}

fn hops(figures: &Figures) -> String {
    let latency = &figures.latency;
    let mut rows = Vec::new();
    let mut row = |name: String, latency: &Distribution| {
        let (samples, percentiles) = (latency.samples, percentiles(latency));
        rows.push(format!("{name} | {samples} | {percentiles}"));
    };
    for hop in &latency.hops {
        if let Some(transport) = &hop.transport {
            row(format!("transport to {}", hop.stage), transport);
        }
        row(format!("{}, wait", hop.stage), &hop.wait);
        row(format!("{}, work", hop.stage), &hop.work);
    }
    if latency.hops.is_empty() {
        return String::new();
    }
    let all = "sensor to pose, scans with a pose".to_owned();
    row(all, &latency.posed);
    table(
        "Hop by hop, of the scans with a pose, ms: *transport* from the publication by the stage before to the reception, *wait* until the work \
         begins, *work*.\n\n",
        "hop | samples | p50 | p90 | p99 | p99.9 | p99.99 | max",
        rows.into_iter(),
    )
}

fn faults(figures: &Figures) -> String {
    let rows = figures.faults.iter().map(|fault| {
        let kind = match fault.kind {
            FaultKind::Stop => "stopped for 1 s",
            FaultKind::Kill => "killed",
        };
        let recovery = fault.recovery_ms;
        let recovery = recovery.map_or("never".to_owned(), |ms| format!("{ms:.1}"));
        let (at_s, stage) = (fault.at_s, fault.stage);
        format!("{at_s:.2} | {kind} | {stage} | {recovery}")
    });
    let mut text = table("", "at, s | fault | stage | recovered after, ms", rows);
    if !text.is_empty() {
        text += "\nRecovered: from the kill, or from the end of the stop, to the first pose that the stage has worked on since; the wait for the next scan \
                 is part of it.\n";
    }
    text
}

fn witness_faults(figures: &Figures) -> String {
    let rows = figures.witness_faults.iter().map(|fault| {
        let recovery = fault.recovery_ms;
        let recovery = recovery.map_or("never".to_owned(), |ms| format!("{ms:.0}"));
        let (at_s, name, by) = (fault.at_s, fault.name(), by_basis(&fault.counts));
        let (noticed, motions) = (fault.noticed, fault.motions);
        format!("{at_s:.2} | {name} | {noticed} of {motions} motions | {by} | {recovery}")
    });
    let columns = "at, s | fault | noticed in | which are | recovered after, ms";
    let mut text = table("", columns, rows);
    if !text.is_empty() {
        let all = by_basis(&figures.motions);
        let degraded = figures.motions.degraded_percent().unwrap_or(0.0);
        text += &format!(
            "\nRecovered: from the end of the fault by the sensor's clock to the first pose of a motion that is as before it; the wait for the next scan is \
             part of it. All motions: {all}; {degraded:.1} % degraded.\n"
        );
    }
    text
}

/// Returns `radar only 3, dead reckoning 8`.
fn by_basis(counts: &WitnessCounts) -> String {
    let counted = Basis::ALL.iter().zip(counts.by_basis);
    let counted = counted.filter(|(_, count)| *count > 0);
    let words: Vec<String> = counted
        .map(|(basis, count)| format!("{} {count}", basis.name()))
        .collect();
    words.join(", ")
}

fn processes(figures: &Figures) -> String {
    let row = |name: &str, cost: &Cost| {
        format!(
            "{name} | {:.2} | {:.1} | {:.1} | {:.1}",
            cost.cpu_percent, cost.own_mb, cost.wake_ups_per_s, cost.preemptions_per_s
        )
    };
    let rows = figures.processes.iter().map(|cost| match cost.processes {
        1 => row(&cost.name, cost),
        processes => row(&format!("{} ({processes} processes)", cost.name), cost),
    });
    let all = Cost::sum(&figures.processes).map(|all| row("all", &all));
    let mut text = table(
        "",
        "process | processor, % of one | own memory, MB | wake-ups/s | taken off a processor/s",
        rows.chain(all),
    );
    if text.is_empty() {
        return text;
    }
    let shared_mb = figures.shared_bytes as f64 * 1e-6;
    text += &format!("\nShared memory: {shared_mb:.1} MB.\n");
    if let Some(Taken {
        taken_mb,
        available_mb,
    }) = figures.taken
    {
        text += &format!(
            "\nTaken beside it: {taken_mb:.0} MB of the {available_mb:.0} MB that were available.\n"
        );
    }
    text
}

fn steps(outcome: &ScenarioOutcome) -> String {
    let level = |level: Option<f64>| level.map_or("none".to_owned(), |level| format!("{level:.1}"));
    let (found, failed) = (level(outcome.best), level(outcome.failed));
    let (figure, unit) = match outcome.scenario {
        Scenario::Ramp => ("The highest rate that passed, scans/s", "scans/s"),
        _ => ("The largest number of 4 Hz radars that passed", "radars"),
    };
    let rows = outcome.steps.iter().map(|step| {
        format!(
            "{:.1} | {} | {} | {} | {} | {:.1} | {}",
            step.level,
            step.due,
            step.dropped,
            ms(step.p50_ms),
            ms(step.p99_ms),
            step.cpu_percent,
            step.reason.as_deref().unwrap_or("passed")
        )
    });
    table(
        &format!("{figure}: **{found}**. The lowest above it that failed, twice: {failed}.\n\n"),
        &format!("{unit} | due | dropped | p50, ms | p99, ms | processor, % of one |"),
        rows,
    )
}

fn copying(costs: &[HandOverCost]) -> String {
    let fine = |ms: Option<f64>| ms.map_or(NONE.to_owned(), |ms| format!("{ms:.3}"));
    let rows = costs.iter().map(|cost| {
        let latency = &cost.to_last_reader;
        format!(
            "{} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {}",
            cost.topic,
            cost.bytes,
            cost.readers,
            cost.medium.name(),
            fine(latency.p50_ms),
            fine(latency.p99_ms),
            fine(latency.max_ms),
            cost.sender_us,
            cost.reader_us,
            cost.own_mb,
            cost.shared_mb,
            cost.missed
        )
    });
    table(
        "From the start of the sending until the last reader has the message, ms; processor time of the sender (without the time to write the \
         message) and of a reader for a message, us. Both ways: one process for the sender and one for each reader, 50 messages/s, readers that sleep in \
         `ppoll` and read a byte of each cache line.\n\n",
        "message | bytes | readers | way | p50 | p99 | max | sender, us | a reader, us | own memory, MB | shared memory, MB | missed",
        rows,
    )
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

/// Returns three digits, and no more than three after the point: clocks are not finer.
fn ms(ms: Option<f64>) -> String {
    match ms {
        None => NONE.to_owned(),
        Some(ms) if ms >= 100.0 => format!("{ms:.0}"),
        Some(ms) if ms >= 10.0 => format!("{ms:.1}"),
        Some(ms) if ms >= 1.0 => format!("{ms:.2}"),
        Some(ms) => format!("{ms:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{fault::Fault, record::RunLatency};

    #[test]
    fn a_page_has_the_tables_of_what_was_measured_and_no_empty_ones() {
        let kill = Fault {
            kind: FaultKind::Kill,
            stage: "masking",
            at_s: 1.5,
            recovery_ms: Some(40.0),
        };
        let counts = Counts {
            due: 240,
            posed: 238,
            dropped: 2,
            ..Counts::default()
        };
        let mut outcome = ScenarioOutcome::new(Scenario::Kills, Duration::from_secs(60));
        outcome.figures = Some(Figures {
            latency: RunLatency {
                counts,
                ..RunLatency::default()
            },
            faults: vec![kill],
            ..Figures::default()
        });
        let page = page(&Report::of(vec![outcome]));
        for part in [
            " | max | closed loop p50 | p99 | max |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n\
             | kills | 4 | 240 | 2 | - | - | - | - | - | - | - | - | - |\n",
            "\n## kills\n\nStages that are killed (SIGKILL), at 4 scans/s. 60 s.\n\n240 scans were due: ",
            "\n\n| at, s | fault | stage | recovered after, ms |\n|---|---|---|---|\n\
             | 1.50 | killed | masking | 40.0 |\n\nRecovered: ",
        ] {
            assert!(page.contains(part), "{part}\nis not in\n{page}");
        }
        assert!(!page.contains("| process |") && !page.contains("| limit |"));
    }
}
