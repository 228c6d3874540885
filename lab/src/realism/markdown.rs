//! The tables of `gyre-lab realism` as Markdown.

use super::{Report, comparison::Row, statistics::ScanStatistics};
use crate::report::{number, or_dash, table};

/// Ranges at which powers are listed, m.
const RANGES_M: [f64; 10] = [2.0, 5.0, 10.0, 20.0, 40.0, 80.0, 120.0, 160.0, 200.0, 290.0];
/// Shares of the histogram that are listed.
const SHARES: [f64; 7] = [0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.999];
/// Lowest powers that are listed.
const LOWEST_LEVELS: usize = 12;

/// Returns the character of each recording, then how they compare.
pub fn of(report: &Report) -> String {
    let name =
        |subject: &super::Subject| format!("{}: {}", subject.role, subject.measured.whole.name);
    let names: Vec<String> = report.subjects.iter().map(name).collect();
    let grid = report.grid;
    format!(
        "# Realism\n\nPowers averaged over {:.4} m of range up to {:.1} m, the coarsest and the shortest of the recordings'; saturation \
         and levels in the sensors' own bins; consecutive scans compared in cells of {} m; `within` is between a recording's halves, \
         and what is no more than that is chance.\n\n## Each recording\n\n{}\n## Comparison\n\n{}",
        grid.resolution_m,
        grid.range_m(),
        report.cell_m,
        characters(report, &names),
        compared(report, names)
    )
}

fn compared(report: &Report, names: Vec<String>) -> String {
    let recordings = report.subjects.len();
    let mut header = vec!["statistic".to_owned()];
    header.extend(names);
    header.extend(["distance", "within real", "sim-real"].map(str::to_owned));
    if recordings == 2 {
        return table(
            &header,
            report.comparison.rows.iter().map(|row| cells(row, 2)),
        );
    }
    header.extend(["real-other", "within other", "sim is"].map(str::to_owned));
    let rows = report.comparison.rows.iter().map(|row| {
        let verdict = match row.closer {
            None => "-",
            Some(true) => "closer",
            Some(false) if row.is_within_chance() => "farther, within chance",
            Some(false) => "farther",
        };
        let mut cells = cells(row, recordings);
        cells.extend([
            number(row.real_other, 3),
            number(row.within_other, 3),
            verdict.to_owned(),
        ]);
        cells
    });
    let (closer, judged) = (report.comparison.closer, report.comparison.judged);
    format!("{}\ncloser in {closer} of {judged}\n", table(&header, rows))
}

fn cells(row: &Row, recordings: usize) -> Vec<String> {
    let mut cells = vec![row.statistic.to_owned()];
    cells.extend(
        row.values
            .iter()
            .take(recordings)
            .map(|value| or_dash(value.as_ref())),
    );
    cells.extend([
        row.distance.to_owned(),
        number(row.within_real, 3),
        number(row.sim_real, 3),
    ]);
    cells
}

/// What a sensor's profile can be set by, a column a recording.
fn characters(report: &Report, names: &[String]) -> String {
    let statistics = report
        .subjects
        .iter()
        .map(|subject| &subject.measured.whole.statistics);
    let columns: Vec<Vec<(String, String)>> = statistics.map(character).collect();
    let rows = (0..columns[0].len()).map(|row| {
        let name = columns[0][row].0.clone();
        std::iter::once(name)
            .chain(columns.iter().map(|column| column[row].1.clone()))
            .collect()
    });
    table(&[&[String::new()], names].concat(), rows)
}

fn character(s: &ScanStatistics) -> Vec<(String, String)> {
    let (levels, streaks) = (&s.levels, &s.streaks);
    let lowest = listed(levels.iter().take(LOWEST_LEVELS));
    let highest = levels.last().copied().unwrap_or(0);
    let lags = |values: &[f64]| listed([1, 2, 4].map(|lag| number(values.get(lag).copied(), 3)));
    let mut rows = vec![
        ("scans measured".to_owned(), s.scans.to_string()),
        (
            "azimuths x bins".to_owned(),
            format!(
                "{} x {} of {:.4} m",
                s.azimuths, s.sensor_bins, s.sensor_resolution_m
            ),
        ),
        (
            "levels that occur".to_owned(),
            format!("{}: {lowest} .. {highest}", levels.len()),
        ),
        (
            format!("power at {} %", listed(SHARES.map(|share| 100.0 * share))),
            listed(SHARES.map(|share| s.histogram.percentile(share))),
        ),
    ];
    for range_m in RANGES_M
        .into_iter()
        .filter(|range_m| s.around(*range_m, |_| 0.0).is_some())
    {
        let percentile = |of: &[u8]| number(s.around(range_m, |cell| f64::from(of[cell])), 0);
        let mean = number(s.around(range_m, |cell| s.mean_power[cell]), 1);
        let percentiles = [&s.floor, &s.median_power, &s.high_power].map(|of| percentile(of));
        let name = format!("at {range_m} m: mean; 10, 50, 99 %");
        rows.push((name, format!("{mean}; {}", listed(percentiles))));
    }
    rows.extend([
        (
            "azimuths' floors at 5, 25, 50, 75, 95, 99 %".to_owned(),
            listed(streaks.floor_percentiles),
        ),
        (
            "streaks: share, groups a scan, width".to_owned(),
            format!(
                "{:.1} %, {:.1}, {:.1}",
                100.0 * streaks.share,
                streaks.groups_a_scan,
                streaks.mean_width
            ),
        ),
        (
            "correlation at lags of 1, 2, 4 cells".to_owned(),
            lags(&s.range_correlation.values),
        ),
        (
            "correlation at lags of 1, 2, 4 azimuths".to_owned(),
            lags(&s.azimuth_correlation.values),
        ),
    ]);
    rows
}

fn listed<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values
        .into_iter()
        .map(|value| value.to_string())
        .collect::<Vec<_>>()
        .join(", ")
}
