//! The document.

use std::collections::{BTreeMap, BTreeSet};

use base64::{Engine, engine::general_purpose::STANDARD};
use gyre_configuration::{difference::keys, terminal::Failure};
use gyre_contract::StageId;
use gyre_geometry::Pose;
use gyre_results::{
    evaluation::plot::paths_svg,
    figures::{Figure, GROUPS},
};
use toml::Table;

use crate::report::{Run, Subject};

/// The groups of figures that stand behind the pictures.
const LAST: [&str; 2] = ["Counts", "Versions"];
/// The pictures of a run: title, file and caption.
#[rustfmt::skip]
const PICTURES: [[&str; 3]; 3] = [
    ["Map", "map.png", "Lighter places returned power more often"],
    ["Errors", "errors.svg", "By the length of segments, as KITTI measures them from 100 m on; of a shorter drive, of each motion"],
    ["Uncertainty", "bands.svg", "The error of each pose within three standard deviations that its covariance states"],
];
/// Pixels of a bar that stands for the longest time.
const BAR: f64 = 160.0;

pub fn page(subjects: &[Subject]) -> Result<String, Failure> {
    let names: Vec<&str> = subjects.iter().map(|it| it.name.as_str()).collect();
    let title = names.join(" · ");
    let [map, errors, bands] = PICTURES.map(|picture| pictures(subjects, picture));
    let body = [
        section("Figures", &figures(subjects, false)),
        section("Trajectory", &trajectories(subjects)?),
        map,
        errors,
        bands,
        section("Latency by stage", &latencies(subjects)),
        section("Counts and versions", &figures(subjects, true)),
        section("Configuration", &configurations(subjects)),
    ];
    Ok(format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n\
         <p>by gyre report, {version}</p>\n{body}</body>\n</html>\n",
        title = escaped(&title),
        style = include_str!("style.css"),
        version = env!("CARGO_PKG_VERSION"),
        body = body.concat(),
    ))
}

/// Returns a table of the figures that a subject has, of the last groups or of the others; nothing
/// without any.
fn figures(subjects: &[Subject], are_last: bool) -> String {
    let (columns, mut rows) = (subjects.len() + 1, String::new());
    let groups = GROUPS.iter();
    for (title, figures) in groups.filter(|(title, _)| LAST.contains(title) == are_last) {
        let figures: String = figures
            .iter()
            .filter_map(|it| figure(it, subjects))
            .collect();
        if !figures.is_empty() {
            rows += &format!("<tr class=\"group\"><th colspan=\"{columns}\">{title}</th></tr>\n");
            rows += &figures;
        }
    }
    let head = head(subjects.iter());
    match rows.is_empty() {
        true => rows,
        false => format!("<div class=\"wide\"><table>\n{head}{rows}</table></div>"),
    }
}

/// Returns a row with a figure of all subjects; `None` if no subject has it. Of errors the smallest
/// is marked, where there are several.
fn figure(figure: &Figure, subjects: &[Subject]) -> Option<String> {
    let values = subjects.iter().map(|it| figure.text(&it.figures));
    let values: Vec<Option<String>> = values.collect();
    values.iter().flatten().next()?;
    let errors = subjects.iter().enumerate();
    let errors = errors.filter_map(|(place, it)| Some((place, figure.error(&it.figures)?)));
    let best = errors.min_by(|(_, one), (_, other)| one.total_cmp(other));
    let best = best.map(|(place, _)| place).filter(|_| subjects.len() > 1);
    let cell = |(place, value): (usize, &Option<String>)| {
        let value = escaped(value.as_deref().unwrap_or(""));
        match best == Some(place) {
            true => format!("<td class=\"best\">{value}</td>"),
            false => format!("<td>{value}</td>"),
        }
    };
    let cells: String = values.iter().enumerate().map(cell).collect();
    Some(format!(
        "<tr><th>{}</th>{cells}</tr>\n",
        escaped(figure.name)
    ))
}

fn head<'a>(subjects: impl ExactSizeIterator<Item = &'a Subject>) -> String {
    if subjects.len() < 2 {
        return String::new();
    }
    let names = subjects.map(|it| format!("<th>{}</th>", escaped(&it.name)));
    let names: String = names.collect();
    format!("<thead><tr><th></th>{names}</tr></thead>\n")
}

fn runs(subjects: &[Subject]) -> impl Iterator<Item = (&Subject, &Run)> {
    subjects
        .iter()
        .filter_map(|it| Some((it, it.run.as_ref()?)))
}

/// Returns the name of one of several runs as a title.
fn title_of(subject: &Subject, subjects: &[Subject]) -> String {
    match subjects.len() {
        1 => String::new(),
        _ => format!("<h3>{}</h3>\n", escaped(&subject.name)),
    }
}

fn trajectories(subjects: &[Subject]) -> Result<String, Failure> {
    let truth = subjects.iter().find_map(|it| it.evaluation.as_ref());
    let truth = truth.map(|evaluation| evaluation.matched.truth());
    let paths = subjects.iter().map(|it| (it.name.as_str(), it.drawn()));
    let paths: Vec<(&str, Vec<Pose>)> = paths.collect();
    let drawn = paths_svg(&paths, truth)?;
    Ok(svg(&drawn, "Trajectories seen from above"))
}

fn pictures(subjects: &[Subject], [title, name, caption]: [&str; 3]) -> String {
    let pictures = runs(subjects).filter_map(|(subject, run)| {
        let bytes = run.picture(name)?;
        let picture = match str::from_utf8(&bytes) {
            Ok(text) => svg(text, title),
            Err(_) => png(&bytes, title),
        };
        Some(format!("{}{picture}\n", title_of(subject, subjects)))
    });
    match pictures.collect::<String>() {
        none if none.is_empty() => none,
        pictures => section(title, &format!("<p>{caption}.</p>\n{pictures}")),
    }
}

fn latencies(subjects: &[Subject]) -> String {
    let table = |(subject, run)| title_of(subject, subjects) + &latency(run);
    runs(subjects).map(table).collect()
}

fn latency(run: &Run) -> String {
    let p50_us = |stage: &str| run.number(&format!("/latency/stages/{stage}/work/p50_us"));
    let stages = StageId::ALL.map(StageId::name).into_iter();
    let there = stages.filter_map(|stage| Some((stage, p50_us(stage)?)));
    let longest_us = there.clone().map(|(_, us)| us).fold(1.0, f64::max);
    let rows = there.map(|(stage, us)| {
        let number = |place: &str, factor: f64, decimals: usize| {
            let value = run.number(&format!("/latency/stages/{stage}/{place}"));
            let text = value.map(|value| format!("{:.decimals$}", value * factor));
            format!("<td class=\"number\">{}</td>", text.unwrap_or_default())
        };
        let width = BAR * us / longest_us;
        format!(
            "<tr><th>{stage}</th>{}{}{}{}{}<td><span class=\"bar\" style=\"width:{width:.0}px\"></span></td></tr>\n",
            number("work/p50_us", 1e-3, 2),
            number("work/p99_us", 1e-3, 2),
            number("work/max_us", 1e-3, 2),
            number("transport/p50_us", 1e-3, 2),
            number("busy", 100.0, 0),
        )
    });
    let rows: String = rows.collect();
    let numbers = [
        "median, ms",
        "99 %, ms",
        "max, ms",
        "transport, ms",
        "busy, %",
    ];
    let numbers = numbers.map(|name| format!("<th class=\"number\">{name}</th>"));
    match rows.is_empty() {
        true => rows,
        false => format!(
            "<div class=\"wide\"><table>\n<thead><tr><th>stage</th>{}<th></th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n",
            numbers.concat()
        ),
    }
}

/// Returns the configuration of a run, or the keys that differ between several runs.
fn configurations(subjects: &[Subject]) -> String {
    let runs: Vec<(&Subject, &Run)> = runs(subjects).collect();
    match &runs[..] {
        [] => String::new(),
        [(_, run)] => format!(
            "<details><summary>as it was resolved: a run from it repeats this one</summary>\n<pre>{}</pre></details>",
            escaped(&run.configuration)
        ),
        runs => differences(runs),
    }
}

fn differences(runs: &[(&Subject, &Run)]) -> String {
    let table = |run: &Run| run.configuration.parse::<Table>().unwrap_or_default();
    let keys = runs.iter().map(|(_, run)| keys(&table(run)));
    let keys: Vec<BTreeMap<String, String>> = keys.collect();
    let all: BTreeSet<&String> = keys.iter().flat_map(BTreeMap::keys).collect();
    let differ = |key: &&&String| keys.iter().any(|it| it.get(**key) != keys[0].get(**key));
    let rows = all.iter().filter(differ).map(|key| {
        let values = keys
            .iter()
            .map(|it| it.get(*key).map_or("", String::as_str));
        let cells = values.map(|value| format!("<td>{}</td>", escaped(value)));
        let (key, cells) = (escaped(key), cells.collect::<String>());
        format!("<tr><th>{key}</th>{cells}</tr>\n")
    });
    let rows: String = rows.collect();
    if rows.is_empty() {
        return "<p>All keys are equal.</p>".to_owned();
    }
    let head = head(runs.iter().map(|(it, _)| *it));
    format!(
        "<p>The keys in which the runs differ.</p>\n<div class=\"wide\"><table>\n{head}<tbody>\n{rows}</tbody></table></div>"
    )
}

fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// Returns a section with a title; nothing without a content.
fn section(title: &str, content: &str) -> String {
    match content.is_empty() {
        true => String::new(),
        false => {
            let title = escaped(title);
            format!("<section><h2>{title}</h2>\n{content}\n</section>\n")
        }
    }
}

fn png(bytes: &[u8], what: &str) -> String {
    let what = escaped(what);
    let data = STANDARD.encode(bytes);
    format!("<figure><img alt=\"{what}\" src=\"data:image/png;base64,{data}\"></figure>")
}

/// Returns a picture that is a document of SVG, which a reader of screens names.
fn svg(text: &str, what: &str) -> String {
    let what = escaped(what);
    let text = text.find("<svg").map_or("", |start| &text[start..]);
    format!("<figure role=\"img\" aria-label=\"{what}\">{text}</figure>")
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use gyre_datasets::read_trajectory;

    use super::*;

    const SUMMARY: &str = r#"{"problem": "a mask", "dropped": 3, "period_s": 0.25, "version": "0.1.0", "latency": {"sensor_to_pose":
        {"p50_us": 31000.0, "p99_us": 58000.0}, "stages": {"masking": {"work": {"p50_us": 5000.0}, "busy": 0.2}}}}"#;

    /// A drive of 200 m straight ahead at 10 m/s, which ends so far to the left.
    fn tum(left_m: f64) -> String {
        let line = |k: u32| {
            let (s, x) = (f64::from(k), 10.0 * f64::from(k));
            format!("{s} {x} {} 0 0 0 0 1\n", left_m * s / 20.0)
        };
        (0..=20).map(line).collect()
    }

    fn run(folder: &Path, left_m: f64, configuration: &str) {
        fs::create_dir_all(folder).unwrap();
        fs::write(folder.join("trajectory.tum"), tum(left_m)).unwrap();
        fs::write(folder.join("summary.json"), SUMMARY).unwrap();
        fs::write(folder.join("config.toml"), configuration).unwrap();
    }

    fn page_of(paths: &[&Path], truth: &Path) -> String {
        let truth = read_trajectory(truth).unwrap();
        let paths: Vec<_> = paths.iter().map(|path| (*path).to_owned()).collect();
        let paths = crate::report::with_corrected(&paths);
        let subjects = paths
            .iter()
            .map(|path| Subject::read(path, Some(&truth)).unwrap());
        page(&subjects.collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn a_page_about_a_run_has_its_figures_its_picture_and_its_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let (a, truth) = (
            folder.path().join("<\"a&>"),
            folder.path().join("truth.tum"),
        );
        fs::write(&truth, tum(0.0)).unwrap();
        run(&a, 0.0, "[run]\nmode = 'live'\n");
        fs::write(a.join("map.png"), [0x89, b'P', 0xff]).unwrap();
        let page = page_of(&[&a], &truth);
        for part in [
            "<tr><th>problem</th><td>a mask</td></tr>",
            "<tr><th>path, m</th><td>200.0</td></tr>",
            "<tr><th>ATE, rmse, m</th><td>0.000</td></tr>",
            "<tr><th>scans dropped</th><td>3</td></tr>",
            "<tr><th>latency, 99 %, ms</th><td>58.0</td></tr>",
            "<tr><th>masking</th><td class=\"number\">5.00</td>",
            "data:image/png;base64,iVD/",
            "mode = 'live'",
            "<svg ",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("<\"a&>") && page.contains("&lt;&quot;a&amp;&gt;"));
        assert!(page.contains("<h2>Map</h2>") && !page.contains("<h2>Errors</h2>"));
        assert!(!page.contains("src=\"http") && !page.contains("href="));
        fs::write(a.join("trajectory_slam.tum"), tum(4.0)).unwrap();
        let page = page_of(&[&a], &truth);
        let rows = "<tr><th>path, m</th><td>200.0</td><td>200.0</td></tr>";
        assert!(page.contains(rows) && page.contains("&gt;/trajectory_slam.tum</th>"));
    }

    #[test]
    fn runs_and_trajectories_of_other_programs_are_compared() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("truth.tum"), tum(0.0)).unwrap();
        fs::write(at("other.tum"), tum(4.0)).unwrap();
        run(&at("a"), 0.0, "[raster]\nn = 255\ncell_m = 0.8\n");
        run(&at("b"), 2.0, "[raster]\nn = 127\ncell_m = 0.8\n");
        let page = page_of(&[&at("a"), &at("b"), &at("other.tum")], &at("truth.tum"));
        let mut lines = page.lines();
        let row = lines.find(|line| line.contains("ATE, rmse")).unwrap();
        assert!(row.contains("<td class=\"best\">0.000</td>"), "{row}");
        assert_eq!(row.matches("<td").count(), 3, "{row}");
        assert!(page.contains("<tr><th>raster.n</th><td>255</td><td>127</td></tr>"));
        assert!(!page.contains("raster.cell_m"));
        assert!(page.contains("<tr><th>scans dropped</th><td>3</td><td>3</td><td></td></tr>"));
    }
}
