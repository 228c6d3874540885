//! Reads `odometry.csv` back, by the names in its header: other columns may come and go.

use std::{fs, path::Path, str::FromStr};

use gyre_evaluation::TimedMotion;
use gyre_geometry::{UncertainMotion, covariance::unpack, pose};

use crate::Failure;

const TIMES: [&str; 2] = ["stamp_ns", "interval_ns"];
const MOTION: [&str; 3] = ["x_m", "y_m", "yaw_rad"];
const COVARIANCE: [&str; 6] = [
    "cov_xx",
    "cov_xy",
    "cov_xyaw",
    "cov_yy",
    "cov_yyaw",
    "cov_yawyaw",
];

/// The motions of an `odometry.csv`. A covariance that is left empty becomes NaN: a motion that has none.
pub fn read(path: &Path) -> Result<Vec<TimedMotion>, Failure> {
    let text = fs::read_to_string(path)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    parse(&text).map_err(|reason| format!("{}{reason}", path.display()).into())
}

/// As [`read`]; the error goes on where the file's name ended.
fn parse(text: &str) -> Result<Vec<TimedMotion>, String> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines
        .next()
        .unwrap_or_default()
        .split(',')
        .map(str::trim)
        .collect();
    let columns = Columns {
        times: find(&header, TIMES)?,
        motion: find(&header, MOTION)?,
        covariance: find(&header, COVARIANCE)?,
    };
    let row = |(index, line): (usize, &str)| {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        match fields.len() == header.len() {
            true => columns.motion(&fields),
            false => Err(format!(
                "{} fields, {} in the header",
                fields.len(),
                header.len()
            )),
        }
        .map_err(|reason| format!(", line {}: {reason}", index + 2))
    };
    lines
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(row)
        .collect()
}

/// Where in a row the values stand.
struct Columns {
    times: [usize; 2],
    motion: [usize; 3],
    covariance: [usize; 6],
}

impl Columns {
    fn motion(&self, fields: &[&str]) -> Result<TimedMotion, String> {
        let [to_ns, interval_ns] = values::<i64, 2>(fields, self.times)?;
        let [x, y, yaw] = values::<f64, 3>(fields, self.motion)?;
        let or_none = self.covariance.map(|column| {
            if fields[column].is_empty() {
                "NaN"
            } else {
                fields[column]
            }
        });
        let covariance = unpack(&values(&or_none, [0, 1, 2, 3, 4, 5])?);
        let motion = pose(x, y, yaw);
        let from_ns = to_ns
            .checked_sub(interval_ns)
            .ok_or("interval_ns is none")?;
        Ok(TimedMotion {
            from_ns,
            to_ns,
            estimate: UncertainMotion { motion, covariance },
        })
    }
}

fn find<const N: usize>(header: &[&str], names: [&str; N]) -> Result<[usize; N], String> {
    let mut columns = [0; N];
    for (column, name) in columns.iter_mut().zip(names) {
        let place = header.iter().position(|field| *field == name);
        *column =
            place.ok_or_else(|| format!(" is no odometry.csv: its header has no column {name}"))?;
    }
    Ok(columns)
}

fn values<T: FromStr + Default + Copy, const N: usize>(
    fields: &[&str],
    columns: [usize; N],
) -> Result<[T; N], String> {
    let mut values = [T::default(); N];
    for (value, column) in values.iter_mut().zip(columns) {
        *value = fields[column]
            .parse()
            .map_err(|_| format!("{:?} is no number", fields[column]))?;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_messages::{Item, MotionEstimate, PoseHeader};

    use super::*;
    use crate::odometry::{csv, motions};

    fn poses() -> Vec<PoseHeader> {
        let pose = |k: i64| PoseHeader {
            item: Item {
                stamp_ns: 1_549_986_608_000_000_007 + 250_000_000 * k,
                ..Item::default()
            },
            motion: MotionEstimate {
                x_m: 1.5,
                y_m: -0.25,
                yaw_rad: 0.125 * k as f64,
                covariance: [0.04, 0.001, 0.002, 0.05, 0.003, 0.006],
                interval_ns: 250_000_000,
                ..MotionEstimate::default()
            },
            ..PoseHeader::default()
        };
        (1..4).map(pose).collect()
    }

    #[test]
    fn what_was_written_is_read_whatever_columns_stand_beside_it() {
        let (poses, text) = (poses(), csv(&poses()));
        assert_eq!(parse(&text).unwrap(), motions(&poses));
        let wider: String = text
            .lines()
            .map(|line| format!("new,{line},newer\n"))
            .collect();
        assert_eq!(parse(&wider).unwrap(), motions(&poses));
    }

    #[test]
    fn an_empty_covariance_is_none_and_the_motion_stays() {
        let read = parse(&csv(&poses()).replace("0.040000000000", "")).unwrap();
        assert_eq!(read.len(), 3);
        assert!(
            read[0].estimate.motion == motions(&poses())[0].estimate.motion
                && !read[0].estimate.has_covariance()
        );
    }

    #[test]
    fn other_files_and_damaged_rows_are_named() {
        assert!(parse("").unwrap_err().contains("no column stamp_ns"));
        let text = csv(&poses());
        assert!(
            parse(&text.replacen("cov_yyaw", "c", 1))
                .unwrap_err()
                .contains("no column cov_yyaw")
        );
        assert_eq!(
            parse(&text.replacen("1.500000000", "far", 1)).unwrap_err(),
            ", line 2: \"far\" is no number"
        );
        let cut = &text[..text.len() - 40];
        assert!(parse(cut).unwrap_err().starts_with(", line 4: "));
        assert!(parse(&text.replace(",250000000,", ",-9223372036854775808,")).is_err());
    }
}
