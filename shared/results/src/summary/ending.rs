//! The summary that a run prints at its end on a terminal.

use std::{env, path::Path};

use gyre_configuration::terminal::{WIDTH, wrap};
use gyre_contract::run::{Ending, Rate};

use super::Summary;
use crate::figures::all_unusual;

const NAMES: usize = 12;

impl Summary {
    /// Returns a line each for the path, its accuracy, the latency, unusual events and the files;
    /// with SLAM one for the loops, and one for a problem.
    pub fn in_brief(&self) -> String {
        let unusual = all_unusual(&self.figures());
        let lines = [
            (self.ending_word(), Some(self.path())),
            ("problem", self.problem.clone()),
            ("accuracy", Some(self.accuracy())),
            ("loops", self.loops()),
            ("latency", Some(self.pace())),
            ("unusual", Some(unusual)),
            ("look at", Some(self.places())),
        ];
        let lines = lines.into_iter().filter_map(|(name, text)| {
            let (text, indent) = (text?, format!("\n{:NAMES$}", ""));
            let text = wrap(&text, WIDTH - NAMES).join(&indent);
            Some(format!("{name:NAMES$}{text}"))
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    fn loops(&self) -> Option<String> {
        let slam = self.slam.as_ref()?;
        let ate = slam.ate_m.map_or(String::new(), |ate_m| {
            format!("; ATE after correction {ate_m:.3} m rmse")
        });
        Some(format!(
            "{} loops between {} keyframes, {} rejected{ate}; trajectory_slam.tum, map.png",
            slam.loops_used, slam.keyframes, slam.loops_rejected
        ))
    }

    fn ending_word(&self) -> &'static str {
        match self.ending {
            Some(Ending::Complete) => "complete",
            Some(Ending::Interrupted) => "interrupted",
            None => "failed",
        }
    }

    fn path(&self) -> String {
        let of = self.scans_in_recording.map_or(0, |scans| scans as u64);
        let scans = match self.counts.processed {
            poses if poses < of => format!("{poses} of {of} scans"),
            poses => format!("{poses} scans"),
        };
        format!(
            "{:.0} m in {:.0} s of driving, {scans}; computed in {:.1} s",
            self.course.path_m, self.course.duration_s, self.wall_s
        )
    }

    fn accuracy(&self) -> String {
        let Some(judgement) = &self.evaluation else {
            let out = self.folder();
            return format!("no ground truth: gyre evaluate {out} compares the run with itself");
        };
        let evaluation = &judgement.evaluation;
        let ate = format!("ATE {:.2} m", evaluation.ate.rmse_m);
        match &evaluation.kitti {
            Some(kitti) => format!(
                "{ate}; drift {:.2} % and {:.2} deg/100 m",
                kitti.translation_percent, kitti.rotation_deg_per_100m
            ),
            None => ate,
        }
    }

    /// Returns the latency beside the time that the sensor takes for a scan; of a run as fast as it
    /// goes, whose scans wait for each other, the rate.
    fn pace(&self) -> String {
        let p99_ms = self.latency.sensor_to_pose.p99_us / 1e3;
        let Some(period_s) = self.course.period_s else {
            return format!("{p99_ms:.0} ms (99 %)");
        };
        if self.rate == Rate::Max {
            let (per_s, own_per_s) = (self.scans_per_s, 1.0 / period_s);
            let times = per_s * period_s;
            return format!("{per_s:.1} scans/s, {times:.1} times the radar's {own_per_s:.1}");
        }
        let p50_ms = self.latency.sensor_to_pose.p50_us / 1e3;
        let period_ms = period_s * 1e3 / self.rate.factor().unwrap_or(1.0);
        let verdict = match p99_ms < period_ms {
            true => "within",
            false => "MORE THAN",
        };
        format!(
            "{p50_ms:.0} ms (median), {p99_ms:.0} ms (99 %): {verdict} the {period_ms:.0} ms of a scan"
        )
    }

    /// Returns the folder of the results, as short as a person here would write it.
    fn folder(&self) -> String {
        let out = Path::new(&self.out);
        let here = env::current_dir().ok();
        let short = here.and_then(|here| out.strip_prefix(here).ok());
        short.unwrap_or(out).display().to_string()
    }

    fn places(&self) -> String {
        let again = match self.ending {
            Some(Ending::Complete) => "",
            _ => "; the same command continues from here",
        };
        let out = self.folder();
        format!("gyre report {out} --open; all figures: {out}/summary.json, or -v{again}")
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gyre_configuration::Configuration;
    use gyre_contract::{Witness, run::latency::Latency};

    use super::*;
    use crate::summary::{
        Counts, Course, HARDLY_MEASURED, Measured, Session, SlamSummary,
        counts::MotionCounts,
        sensors::{SensorCount, SensorCounts},
    };

    fn summary(rate: &str, counts: Counts, p99_us: f64) -> Summary {
        let overrides = [format!("run.rate='{rate}'"), "gyro.kind='auto'".to_owned()];
        let configuration = Configuration::of_overrides(&overrides).unwrap();
        let session = Session {
            scans: Some(466),
            resumed: 0,
            damage: None,
            needs_all: false,
            wall: Duration::from_millis(14_200),
            footprint: None,
            ending: Some(Ending::Complete),
            report: None,
        };
        let mut latency = Latency {
            scans: 466,
            ..Latency::default()
        };
        (latency.sensor_to_pose.p50_us, latency.sensor_to_pose.p99_us) = (31_000.0, p99_us);
        let measured = Measured {
            counts,
            course: Course {
                path_m: 885.2,
                duration_s: 116.4,
                period_s: Some(0.25),
            },
            latency,
            evaluation: None,
            slam: None,
            gnss: None,
        };
        Summary::new(&configuration, "out/radiate".as_ref(), &session, measured)
    }

    #[test]
    fn a_run_without_faults_ends_with_five_lines_that_fit() {
        let counts = Counts {
            processed: 466,
            ..Counts::default()
        };
        let text = summary("realtime", counts, 58_000.0).in_brief();
        let expected = "\
complete    885 m in 116 s of driving, 466 scans; computed in 14.2 s
accuracy    no ground truth: gyre evaluate out/radiate compares the run with
            itself
latency     31 ms (median), 58 ms (99 %): within the 250 ms of a scan
unusual     nothing
look at     gyre report out/radiate --open; all figures:
            out/radiate/summary.json, or -v";
        assert_eq!(text, expected);
        let mut with_loops = summary("realtime", Counts::default(), 58_000.0);
        with_loops.slam = Some(SlamSummary {
            loops_used: 142,
            ate_m: Some(0.5),
            ..SlamSummary::default()
        });
        let expected = "\nloops       142 loops between 0 keyframes, 0 rejected; ATE after";
        assert!(with_loops.in_brief().contains(expected));
    }

    #[test]
    fn what_is_unusual_is_counted_and_a_late_pose_is_told() {
        let counts = Counts {
            processed: 463,
            dropped: 3,
            motions: Some(MotionCounts {
                weak: 2,
                ..MotionCounts::default()
            }),
            ..Counts::default()
        };
        let text = summary("2", counts, 158_000.0).in_brief();
        assert!(text.contains("463 of 466 scans"), "{text}");
        assert!(text.contains("MORE THAN the 125 ms of a scan"), "{text}");
        assert!(text.contains("unusual     3 scans dropped, 2 motions weak\n"));
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH));
        // A run as fast as it goes is compared by its rate.
        let text = summary("max", Counts::default(), 1e6).in_brief();
        let expected = "latency     32.8 scans/s, 8.2 times the radar's 4.0\n";
        assert!(text.contains(expected), "{text}");
    }

    #[test]
    fn motions_without_a_match_and_sensors_that_are_wrong_or_unused_are_a_problem() {
        let problem_of = |unsure, doubted, slips, scale, delay_s, headings| {
            let mut gyro = SensorCount {
                motions: 400,
                doubted,
                delay_and_scale: Some([[delay_s, 0.03], [scale, 0.004]]),
                ..SensorCount::default()
            };
            gyro.last.scale = scale;
            let wheels = SensorCount {
                motions: 400,
                refused: slips,
                ..SensorCount::default()
            };
            let heading = SensorCount {
                motions: 400,
                refused: headings,
                ..SensorCount::default()
            };
            let gyro = (scale > 0.0).then_some(gyro);
            let motions = MotionCounts {
                refined: 465,
                unsure,
                ..MotionCounts::default()
            };
            let counts = Counts {
                processed: 466,
                motions: Some(motions),
                sensors: SensorCounts(Witness::ALL.map(|kind| match kind {
                    Witness::Gyro => gyro,
                    Witness::Wheels => Some(wheels),
                    Witness::Heading => Some(heading),
                    Witness::Doppler => None,
                })),
                ..Counts::default()
            };
            let summary = summary("max", counts, 1e6);
            let problem = summary.problem().map(ToString::to_string);
            assert_eq!(summary.in_brief().contains("\nproblem "), problem.is_some());
            problem.unwrap_or_default()
        };
        let problem = |unsure, doubted, slips, scale, delay_s| {
            problem_of(unsure, doubted, slips, scale, delay_s, 40)
        };
        let mirrored = problem_of(0, 0, 0, 1.0, 0.0, 41);
        let expected = "the heading contradicts the radar: 41 of its 400 headings were refused";
        assert!(mirrored.contains(expected), "{mirrored}");
        assert_eq!(problem(93, 40, 200, 1.03, -0.11), "");
        assert!(problem(94, 0, 0, 1.0, 0.0).contains(HARDLY_MEASURED));
        assert!(problem(0, 41, 0, 1.0, 0.0).contains("41 of its 400 turns"));
        assert!(problem(0, 0, 201, 1.0, 0.0).contains("201 of their 400"));
        assert!(problem(0, 0, 0, 1.05, 0.0).contains("set gyro.scale=1.050"));
        assert!(problem(0, 0, 0, 1.0, -0.3).contains("set gyro.delay_s=-0.30"));
        assert!(problem(0, 0, 0, 0.0, 0.0).contains("gyro.kind is set, but none of the 465"));
    }
}
