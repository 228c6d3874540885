//! The tables as Markdown.

use std::fmt::Write;

use super::{
    Tables,
    accuracy::{Accuracies, Accuracy, AccuracyLine},
    ladder::{Ladder, Step, steps},
    models::{Model, Note, note},
    times::{Median, TimeLine, Times},
    variations::{Variation, Variations},
};

/// Both tables with all that is needed to read and to repeat them.
pub(super) fn of(tables: &Tables) -> String {
    let commit = tables
        .commit
        .map(|commit| format!(" ({commit})"))
        .unwrap_or_default();
    let mut text = format!(
        "# Tables by gyre {}{commit}\n\n{}; {}\n\n```sh\n{}\n```\n\nThe papers' figures: {}.\n\n",
        tables.version, tables.machine, tables.date, tables.command, tables.papers
    );
    text += &tables.times.as_ref().map(times).unwrap_or_default();
    for sequence in &tables.accuracy {
        text += &accuracies(sequence);
    }
    for sequence in &tables.variations {
        text += &variations(sequence);
    }
    text + &ladders(&tables.ladders)
}

fn times(times: &Times) -> String {
    let header = [
        "n",
        "cell m",
        "row",
        "ms",
        "Hz",
        "peer ms",
        "peer Hz",
        "peer / ours",
        "paper Hz, laptop",
        "paper Hz, Jetson",
    ];
    let mut text = format!(
        "## IIIa: time of a search\n\n{}",
        table(&header, times.lines.iter().map(time_line))
    );
    let _ = writeln!(
        text,
        "\nms: for a scan, one thread, median of {} passes over {} scans of {}, the earlier scan's spectrum kept as in a \
         run (not where a mask looks at both), rasters and points ready. The rows that mask include the mask; mask: that alone. \
         The rows that refine do so at every size with the same points. {}{}Paper: a Core i7 at 2.9 GHz; a Jetson Nano with \
         its GPU. -: not given there, or not there here.",
        times.passes,
        times.scans,
        times.data,
        halves(times),
        peer(times),
    );
    let angles = times
        .lines
        .iter()
        .filter_map(|line| Some((line, line.ours?)));
    let an_angle: Vec<String> = angles
        .filter_map(|(line, ours)| an_angle(line, &ours))
        .collect();
    if !an_angle.is_empty() {
        let _ = writeln!(
            text,
            "\nAn angle of the exhaustive searches, ms: {}.",
            an_angle.join("; ")
        );
    }
    let masked = times
        .lines
        .iter()
        .filter_map(|line| Some((line.model.as_ref()?, format!("{} at {}", line.row, line.n))));
    text + &masks(masked) + &left_out(&times.left_out)
}

/// Which network masked which rows.
fn masks<'a>(masked: impl Iterator<Item = (&'a Model, String)>) -> String {
    let mut notes = Vec::new();
    masked.for_each(|(model, row)| note(&mut notes, model.to_string(), row));
    paragraph("Masks", &notes)
}

fn left_out(notes: &[Note]) -> String {
    paragraph("Left out", notes)
}

/// What is noted, each with its rows; nothing of nothing.
fn paragraph(title: &str, notes: &[Note]) -> String {
    let sentences = notes
        .iter()
        .map(|note| format!("{}: {}", note.rows.join("; "), note.what));
    let sentences: Vec<String> = sentences.collect();
    if sentences.is_empty() {
        String::new()
    } else {
        format!("\n{title}. {}.\n", sentences.join(". "))
    }
}

/// How quiet the machine was.
fn halves(times: &Times) -> String {
    let drift = |ours: Median| (ours.halves_ms[1] / ours.halves_ms[0] - 1.0).abs();
    let most = times
        .lines
        .iter()
        .filter_map(|line| line.ours)
        .map(drift)
        .filter(|drift| drift.is_finite());
    let most = most.fold(0.0, f64::max);
    format!(
        "The two halves of the passes differ by at most {:.0} %. ",
        most * 100.0
    )
}

fn peer(times: &Times) -> String {
    let torch = times.peer_torch.as_ref();
    let text = torch.map(|torch| {
        format!(
            "Peer: PyTorch {torch}, one thread, on noise, its median, between the two halves; it transforms both scans \
             of each pair and tries as many angles. "
        )
    });
    text.unwrap_or_default()
}

fn time_line(line: &TimeLine) -> Vec<String> {
    let ms = line.ours.map(|ours| ours.ms);
    let hz = |ms: Option<f64>| number(ms.map(|ms| 1e3 / ms), 1);
    let [laptop, jetson] = line.paper_hz.map(|hz| number(hz, 1));
    let (ours, peer) = (number(ms, 3), number(line.peer_ms, 2));
    let ratio = number(line.peer_over_ours, 1);
    let cell = number(line.ours.map(|ours| ours.cell_m.into()), 2);
    vec![
        line.n.to_string(),
        cell,
        line.row.to_owned(),
        ours,
        hz(ms),
        peer,
        hz(line.peer_ms),
        ratio,
        laptop,
        jetson,
    ]
}

fn an_angle(line: &TimeLine, ours: &Median) -> Option<String> {
    let angles = ours.angles? as f64;
    let peer = line
        .peer_ms
        .map(|ms| format!(" (peer {:.3})", ms / angles))
        .unwrap_or_default();
    Some(format!(
        "{} at {}: {:.3}{peer}",
        line.row,
        line.n,
        ours.ms / angles
    ))
}

fn accuracies(sequence: &Accuracies) -> String {
    let header = [
        "row",
        "KITTI %",
        "deg/100 m",
        "deg/km",
        "ATE m",
        "seg %",
        "deg a scan",
        "forward",
        "masking ms",
        "search ms",
        "scans/s",
        "paper %",
        "paper deg/km",
    ];
    let mut text = format!("\n## IIIb: accuracy on {}\n\n", sequence.data);
    text += &table(&header, sequence.lines.iter().map(accuracy_line));
    let ours = || sequence.lines.iter().filter_map(|line| line.ours.as_ref());
    text += "\ndeg a scan: rotation error of single motions, RMS. forward: estimated over true distance. ms: median work of \
             the stages in the running pipeline. Paper: its test drives of Oxford Radar RobotCar at this raster's size.";
    text += &truth(ours().next());
    text += "\n";
    text += &masks(
        sequence
            .lines
            .iter()
            .filter_map(|line| Some((line.model.as_ref()?, line.row.to_owned()))),
    );
    text += &left_out(&sequence.left_out);
    text += "\n```sh\n";
    for accuracy in ours() {
        text = text + &accuracy.command + "\n";
    }
    text + "```\n"
}

fn variations(sequence: &Variations) -> String {
    let header = [
        "change",
        "KITTI %",
        "deg/100 m",
        "ATE m",
        "seg %",
        "search ms",
    ];
    let figures = |name: &str, figures: [Option<f64>; 4], ms: Option<f64>| {
        let [translation, rotation, ate, seg] = figures;
        let cells = [
            number(translation, 2),
            number(rotation, 2),
            number(ate, 2),
            number(seg, 3),
            number(ms, 2),
        ];
        std::iter::once(name.to_owned())
            .chain(cells)
            .collect::<Vec<_>>()
    };
    let line = |line: &Variation| {
        let (name, a) = (
            if line.change.is_empty() {
                "as it is"
            } else {
                &line.change
            },
            &line.accuracy,
        );
        let errors = [
            a.translation_percent,
            a.rotation_deg_per_100m,
            a.ate_m,
            a.seg_percent,
        ];
        figures(name, errors, Some(a.search_ms))
    };
    let m = &sequence.median;
    let median = [
        m.translation_percent,
        m.rotation_deg_per_100m,
        m.ate_m,
        m.seg_percent,
    ];
    let lines =
        sequence
            .lines
            .iter()
            .map(line)
            .chain([figures("median of the changes", median, None)]);
    format!(
        "\n## One change at a time on {}\n\n{}",
        sequence.data,
        table(&header, lines)
    )
}

/// The sequences' ladders side by side; a step that one has not is empty there.
fn ladders(sequences: &[Ladder]) -> String {
    if sequences.is_empty() {
        return String::new();
    }
    let mut header = vec!["step"];
    sequences
        .iter()
        .for_each(|_| header.extend(["KITTI %", "deg/100 m", "ATE m", "seg %"]));
    let climbed = |step: &str| {
        sequences
            .iter()
            .any(|sequence| sequence.step(step).is_some())
    };
    let line = |(index, step): (usize, &'static str)| {
        let all = sequences
            .iter()
            .flat_map(|sequence| step_errors(sequence.step(step)));
        std::iter::once(format!("{} {step}", index + 1))
            .chain(all)
            .collect::<Vec<_>>()
    };
    let data: Vec<&str> = sequences
        .iter()
        .map(|sequence| sequence.data.as_str())
        .collect();
    let lines = steps().filter(|step| climbed(step)).enumerate().map(line);
    let mut notes = Vec::new();
    for sequence in sequences {
        let reason = sequence
            .left_out
            .as_ref()
            .map(|reason| format!("no learned mask, for {reason}"));
        reason
            .into_iter()
            .for_each(|reason| note(&mut notes, reason, sequence.data.clone()));
    }
    let masked = sequences
        .iter()
        .filter_map(|sequence| Some((sequence.model.as_ref()?, sequence.data.clone())));
    format!(
        "\n## Ladder\n\nEach step with those before it. From the left: {}.\n\n{}{}{}",
        data.join(", then "),
        table(&header, lines),
        masks(masked),
        left_out(&notes)
    )
}

fn step_errors(step: Option<&Step>) -> [String; 4] {
    let error = |of: fn(&Accuracy) -> Option<f64>, decimals| {
        number(step.and_then(|step| of(&step.accuracy)), decimals)
    };
    [
        error(|a| a.translation_percent, 2),
        error(|a| a.rotation_deg_per_100m, 2),
        error(|a| a.ate_m, 2),
        error(|a| a.seg_percent, 3),
    ]
}

/// What the ground truth does not allow.
fn truth(accuracy: Option<&Accuracy>) -> String {
    match accuracy.map(|accuracy| (accuracy.path_m, accuracy.seg_percent)) {
        Some((None, _)) => " There is no ground truth that fits.".to_owned(),
        Some((Some(path_m), None)) => {
            format!(" The truth is {path_m:.0} m long: KITTI and seg need more than 100 m.")
        }
        _ => String::new(),
    }
}

fn accuracy_line(line: &AccuracyLine) -> Vec<String> {
    let figure = |of: fn(&Accuracy) -> Option<f64>, decimals| {
        number(line.ours.as_ref().and_then(of), decimals)
    };
    let [translation, rotation] = line.paper;
    vec![
        line.row.to_owned(),
        figure(|a| a.translation_percent, 2),
        figure(|a| a.rotation_deg_per_100m, 2),
        figure(|a| a.rotation_deg_per_km, 2),
        figure(|a| a.ate_m, 2),
        figure(|a| a.seg_percent, 2),
        figure(|a| a.pair_rotation_deg, 3),
        figure(|a| a.forward_ratio, 4),
        figure(|a| Some(a.masking_ms), 2),
        figure(|a| Some(a.search_ms), 2),
        figure(|a| a.scans_per_s, 0),
        number(translation, 2),
        number(rotation, 2),
    ]
}

/// A figure in fixed decimals; `-` where there is none.
fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

fn table(header: &[&str], lines: impl Iterator<Item = Vec<String>>) -> String {
    let mut text = format!(
        "| {} |\n|{}\n",
        header.join(" | "),
        "---|".repeat(header.len())
    );
    for line in lines {
        let _ = writeln!(text, "| {} |", line.join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::variations::Medians;
    use gyre::machine::Machine;

    fn accuracy(path_m: Option<f64>, seg_percent: Option<f64>) -> Accuracy {
        Accuracy {
            command: "gyre run it".to_owned(),
            n: 255,
            path_m,
            translation_percent: seg_percent.map(|_| 2.125),
            rotation_deg_per_100m: seg_percent.map(|_| 0.75),
            rotation_deg_per_km: seg_percent.map(|_| 7.5),
            ate_m: path_m.map(|_| 1.5),
            seg_percent,
            pair_rotation_deg: Some(0.1),
            forward_ratio: None,
            masking_ms: 2.0,
            search_ms: 0.75,
            scans_per_s: Some(120.4),
        }
    }

    #[test]
    fn a_line_has_ours_the_peers_and_the_papers_figures() {
        let ours = Median {
            cell_m: 0.4,
            angles: None,
            ms: 0.5,
            halves_ms: [0.5, 0.55],
        };
        let line = |ours: Option<Median>| TimeLine {
            n: 255,
            row: "f-raw",
            model: None,
            ours,
            peer_ms: Some(20.0),
            peer_over_ours: ours.map(|ours| 20.0 / ours.ms),
            paper_hz: [Some(58.2), None],
        };
        let cells = [
            "255", "0.40", "f-raw", "0.500", "2000.0", "20.00", "50.0", "40.0", "58.2", "-",
        ];
        assert_eq!(time_line(&line(Some(ours))), cells);
        assert_eq!(
            time_line(&line(None))[3..8],
            ["-", "-", "20.00", "50.0", "-"]
        );
        let joint = Median {
            angles: Some(31),
            ms: 6.2,
            ..ours
        };
        assert_eq!(
            an_angle(&line(None), &joint).as_deref(),
            Some("f-raw at 255: 0.200 (peer 0.645)")
        );
        assert_eq!(an_angle(&line(None), &ours), None);
    }

    #[test]
    fn every_line_of_a_table_has_as_many_cells_as_its_header() {
        let ours = Some(accuracy(Some(885.0), Some(0.5)));
        let model = Model {
            card: "m/n.toml".into(),
            cell_m: 0.4,
            instead_of: Some("m/o.toml".into()),
        };
        let line = |ours: Option<Accuracy>| AccuracyLine {
            row: "raw",
            model: ours.as_ref().map(|_| model.clone()),
            ours,
            paper: [Some(6.39), Some(20.87)],
        };
        let missing = || {
            vec![Note {
                what: "there is none".to_owned(),
                rows: vec!["a".to_owned(), "b".to_owned()],
            }]
        };
        let sequence = Accuracies {
            configuration: "c.toml".to_owned(),
            data: "drive".to_owned(),
            lines: vec![line(ours), line(None)],
            left_out: missing(),
        };
        let times = Times {
            data: "drive".to_owned(),
            scans: 8,
            passes: 50,
            peer_torch: None,
            lines: Vec::new(),
            left_out: missing(),
        };
        let machine = Machine {
            processor: "A".to_owned(),
            cores: 2,
        };
        let (date, command) = ("2024-02-29".to_owned(), "gyre tables".to_owned());
        let sequences = vec![sequence];
        let one_change = Variation {
            change: "a.b=1".to_owned(),
            accuracy: accuracy(Some(885.0), Some(0.5)),
        };
        let none = Medians {
            translation_percent: None,
            rotation_deg_per_100m: None,
            ate_m: Some(1.5),
            seg_percent: None,
        };
        let variations = vec![Variations {
            data: "drive".to_owned(),
            lines: vec![one_change],
            median: none,
        }];
        let ladder = |seg| Ladder {
            configuration: "c.toml".to_owned(),
            data: "drive".to_owned(),
            lines: vec![Step {
                step: "Eq. 7",
                accuracy: accuracy(Some(885.0), seg),
            }],
            model: None,
            left_out: Some("it rains".to_owned()),
        };
        let tables = Tables {
            version: "1.0",
            commit: Some("abc"),
            machine,
            date,
            command,
            times: Some(times),
            accuracy: sequences,
            variations,
            ladders: vec![ladder(Some(0.5)), ladder(None)],
            papers: "P",
        };
        let text = of(&tables);
        assert!(
            text.starts_with("# Tables by gyre 1.0 (abc)\n\nA, 2 cores; 2024-02-29\n"),
            "{text}"
        );
        assert!(
            text.contains("| raw | 2.12 | 0.75 | 7.50 | 1.50 | 0.50 | 0.100 | - | 2.00 | 0.75 | 120 | 6.39 | 20.87 |")
        );
        assert!(text.contains("```sh\ngyre run it\n```"), "{text}");
        let cells: Vec<usize> = text
            .lines()
            .filter(|l| l.starts_with('|'))
            .map(|l| l.matches('|').count())
            .collect();
        assert!(text.contains(
            "| a.b=1 | 2.12 | 0.75 | 1.50 | 0.500 | 0.75 |\n| median of the changes | - | - | 1.50 | - | - |"
        ));
        assert!(
            text.contains("From the left: drive, then drive.\n"),
            "{text}"
        );
        assert!(
            text.contains("| 1 Eq. 7 | 2.12 | 0.75 | 1.50 | 0.500 | - | - | 1.50 | - |\n"),
            "{text}"
        );
        assert_eq!(
            text.matches("Left out. a; b: there is none.\n").count(),
            2,
            "{text}"
        );
        assert!(
            text.contains("\nMasks. raw: m/n.toml (there is no m/o.toml).\n"),
            "{text}"
        );
        assert!(
            text.contains("\nLeft out. drive; drive: no learned mask, for it rains.\n"),
            "{text}"
        );
        assert_eq!(cells, [11, 11, 14, 14, 14, 14, 7, 7, 7, 7, 10, 10, 10]);
    }

    #[test]
    fn a_truth_that_is_too_short_or_missing_is_told() {
        assert!(truth(Some(&accuracy(Some(22.4), None))).contains("22 m long"));
        assert!(truth(Some(&accuracy(None, None))).contains("no ground truth"));
        assert_eq!(truth(Some(&accuracy(Some(885.0), Some(0.5)))), "");
    }
}
