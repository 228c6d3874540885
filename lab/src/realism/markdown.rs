//! The tables of `gyre realism` as Markdown.

use std::fmt::Write;

use crate::realism::{Recording, ScanStatistics, comparison::Row};

use super::Report;

/// Ranges at which powers are listed, m.
const RANGES_M: [f64; 10] = [2.0, 5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 160.0, 200.0, 290.0];
/// Shares of the histogram that are listed.
const SHARES: [f64; 7] = [0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999];
/// Lowest powers that are listed.
const LOWEST_LEVELS: usize = 12;

/// What each recording is like, then how they compare.
pub fn of(report: &Report) -> String {
    let mut text = String::from("# Realism\n\n");
    let grid = report.grid;
    let _ = writeln!(
        text,
        "Powers averaged over {:.4} m of range up to {:.1} m, the coarsest and the shortest of the recordings'; saturation and levels \
         in the sensors' own bins; consecutive scans compared in cells of {} m; `within` is between a recording's halves, \
         and what is no more than that is chance.\n",
        grid.resolution_m,
        grid.range_m(),
        report.cell_m
    );
    characters(&mut text, report);
    compared(&mut text, report);
    text
}

fn compared(text: &mut String, report: &Report) {
    let _ = writeln!(text, "\n## How they compare\n");
    let names = names(report);
    let judged = report.subjects.len() > 2;
    let mut headings: Vec<String> = std::iter::once("statistic".to_owned())
        .chain(names)
        .collect();
    headings.extend(["distance", "within real", "sim-real"].map(str::to_owned));
    if judged {
        headings.extend(["real-other", "within other", "sim is"].map(str::to_owned));
    }
    row(text, &headings);
    row(text, &vec!["---".to_owned(); headings.len()]);
    for line in &report.comparison.rows {
        row(text, &cells(line, report.subjects.len()));
    }
    if judged {
        let _ = writeln!(
            text,
            "\ncloser in {} of {}",
            report.comparison.closer, report.comparison.judged
        );
    }
}

fn names(report: &Report) -> impl Iterator<Item = String> {
    report
        .subjects
        .iter()
        .map(|subject| format!("{}: {}", subject.role, subject.measured.whole.name))
}

fn cells(line: &Row, recordings: usize) -> Vec<String> {
    let number = |distance: Option<f64>| {
        distance.map_or("-".to_owned(), |distance| format!("{distance:.3}"))
    };
    let values = line
        .values
        .iter()
        .take(recordings)
        .map(|value| value.clone().unwrap_or_else(|| "-".to_owned()));
    let mut cells: Vec<String> = std::iter::once(line.statistic.to_owned())
        .chain(values)
        .collect();
    cells.extend([
        line.distance.to_owned(),
        number(line.within_real),
        number(line.sim_real),
    ]);
    if recordings > 2 {
        let verdict = match line.closer {
            None => "-",
            Some(true) => "closer",
            Some(false) if line.is_within_chance() => "farther, within chance",
            Some(false) => "farther",
        };
        cells.extend([
            number(line.real_other),
            number(line.within_other),
            verdict.to_owned(),
        ]);
    }
    cells
}

/// What each recording is like: what a sensor's profile can be set by.
fn characters(text: &mut String, report: &Report) {
    let _ = writeln!(text, "## What each is like\n");
    row(
        text,
        &std::iter::once(String::new())
            .chain(names(report))
            .collect::<Vec<_>>(),
    );
    row(text, &vec!["---".to_owned(); report.subjects.len() + 1]);
    let recordings = || {
        report
            .subjects
            .iter()
            .map(|subject| &subject.measured.whole)
    };
    let mut line = |name: String, of: &dyn Fn(&Recording) -> String| {
        row(
            text,
            &std::iter::once(name)
                .chain(recordings().map(of))
                .collect::<Vec<_>>(),
        );
    };
    let statistics =
        |of: fn(&ScanStatistics) -> String| move |recording: &Recording| of(&recording.statistics);
    line(
        "scans measured".to_owned(),
        &statistics(|s| s.scans.to_string()),
    );
    line(
        "azimuths x bins".to_owned(),
        &statistics(|s| {
            format!(
                "{} x {} of {:.4} m",
                s.azimuths, s.sensor_bins, s.sensor_resolution_m
            )
        }),
    );
    line("levels that occur".to_owned(), &statistics(levels));
    line(
        format!("power at {} %", listed(SHARES.map(|share| 100.0 * share))),
        &statistics(|s| listed(SHARES.map(|share| s.histogram.percentile(share)))),
    );
    for range_m in RANGES_M {
        if recordings().any(|recording| recording.statistics.mean_power_at(range_m).is_some()) {
            let name = format!("at {range_m} m: mean; 10, 50, 99 %");
            line(name, &|recording| at_range(&recording.statistics, range_m));
        }
    }
    line(
        "azimuths' floors at 5, 25, 50, 75, 95, 99 %".to_owned(),
        &statistics(|s| listed(s.streaks.floor_percentiles)),
    );
    line(
        "streaks: share, groups a scan, width".to_owned(),
        &statistics(|s| {
            let streaks = &s.streaks;
            format!(
                "{:.1} %, {:.1}, {:.1}",
                100.0 * streaks.share,
                streaks.groups_a_scan,
                streaks.mean_width
            )
        }),
    );
    line(
        "correlation at lags of 1, 2, 4 cells".to_owned(),
        &statistics(|s| lags(&s.range_correlation.values)),
    );
    line(
        "correlation at lags of 1, 2, 4 azimuths".to_owned(),
        &statistics(|s| lags(&s.azimuth_correlation.values)),
    );
    line("plain search".to_owned(), &|recording| {
        errors(recording.plain.as_ref())
    });
    line("refined search".to_owned(), &|recording| {
        errors(recording.refined.as_ref())
    });
    let aligned = report.subjects.iter().map(|subject| {
        let aligned = subject.aligned;
        format!(
            "{} by truth, {} by odometry",
            aligned.by_truth, aligned.by_odometry
        )
    });
    row(
        text,
        &std::iter::once("pairs aligned".to_owned())
            .chain(aligned)
            .collect::<Vec<_>>(),
    );
}

fn levels(statistics: &ScanStatistics) -> String {
    let levels = &statistics.levels;
    let lowest = listed(levels.iter().take(LOWEST_LEVELS));
    format!(
        "{}: {lowest} .. {}",
        levels.len(),
        levels.last().copied().unwrap_or(0)
    )
}

fn at_range(statistics: &ScanStatistics, range_m: f64) -> String {
    let Some(mean) = statistics.mean_power_at(range_m) else {
        return "-".to_owned();
    };
    let percentile = |of: &[u8]| {
        statistics
            .around(range_m, |cell| f64::from(of[cell]))
            .unwrap_or(f64::NAN)
    };
    let [floor, median, high] = [
        &statistics.floor,
        &statistics.median_power,
        &statistics.high_power,
    ]
    .map(|of| percentile(of));
    format!("{mean:.1}; {floor:.0}, {median:.0}, {high:.0}")
}

fn lags(values: &[f64]) -> String {
    listed([1, 2, 4].map(|lag: usize| {
        values
            .get(lag)
            .map_or("-".to_owned(), |value| format!("{value:.3}"))
    }))
}

fn errors(errors: Option<&crate::realism::SearchErrors>) -> String {
    let Some(errors) = errors else {
        return "-".to_owned();
    };
    let seg = errors
        .seg_percent
        .map_or(String::new(), |seg| format!(", seg {seg:.2} %"));
    format!(
        "{} motions, {:.0} m: {:.3} m, {:.3} deg, ATE {:.2} m{seg}",
        errors.motions,
        errors.path_m,
        errors.translation_rmse_m,
        errors.rotation_rmse_deg,
        errors.ate_m
    )
}

fn listed<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values
        .into_iter()
        .map(|value| value.to_string())
        .collect::<Vec<_>>()
        .join(", ")
}

fn row(text: &mut String, cells: &[String]) {
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}
