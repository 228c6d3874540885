//! Pose graphs as g2o files: `VERTEX_SE2`, `EDGE_SE2`, `FIX` of the first vertex, and comments.
//!
//! The error of a g2o edge lies along the axes of the keyframe `to` as measured, with an
//! information matrix; the error of a [`Constraint`] along the axes of `from`, with a covariance.

use std::fmt::Write;

use gyre_geometry::{
    Pose, UncertainMotion,
    covariance::{pack, unpack},
    pose, xy_yaw,
};
use nalgebra::Matrix3;
use thiserror::Error;

use crate::estimation::Constraint;

/// The content of a g2o file.
#[derive(Debug, Clone, PartialEq)]
pub struct G2o {
    /// The vertices: the poses of all keyframes.
    pub poses: Vec<Pose>,
    /// The edges: odometry in the order of the keyframes, then loops in the order of the file.
    pub constraints: Vec<Constraint>,
}

/// The reason why a text is refused, with its line, counted from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct G2oError(String);

impl G2o {
    /// The beginning of the comment with the number of the fixes of GNSS.
    pub const FIXES: &str = "# fixes";

    /// Reads a file with the vertices in the order of their ids, from 0, and edges after them. The
    /// first edge from each keyframe to the next one is odometry; all others are independent loops,
    /// but for the last ones if a comment states that these are fixes, which are left out.
    pub fn parse(text: &str) -> Result<Self, G2oError> {
        let (mut poses, mut odometry, mut loops) = (Vec::new(), Vec::new(), Vec::new());
        for (line, text) in (1..).zip(text.lines()) {
            let at = |reason: String| G2oError(format!("line {line}: {reason}"));
            if let Some(fixes) = text.strip_prefix(Self::FIXES) {
                let left = fixes_before(fixes, loops.len()).map_err(at)?;
                loops.truncate(left);
            }
            let mut words = text.split_whitespace();
            match words.next() {
                None | Some("FIX") => {}
                Some(comment) if comment.starts_with('#') => {}
                Some("VERTEX_SE2") => {
                    let needed = "VERTEX_SE2 needs an id, x, y and yaw";
                    let ([id], [x, y, yaw]) = fields(words, needed).map_err(at)?;
                    if id != poses.len() {
                        let next = poses.len();
                        return Err(at(format!("vertex {id} is in the place of vertex {next}")));
                    }
                    poses.push(pose(x, y, yaw));
                }
                Some("EDGE_SE2") => {
                    let ([from, to], motion) = edge(words, poses.len()).map_err(at)?;
                    match from == odometry.len() && to == from + 1 {
                        true => odometry.push(Constraint::odometry(from, motion)),
                        false => loops.push(Constraint::closing(from, to, motion)),
                    }
                }
                Some(tag) => {
                    let reason = format!("{tag:?} is not read, only VERTEX_SE2, EDGE_SE2 and FIX");
                    return Err(at(reason));
                }
            }
        }
        let (last, next) = (odometry.len(), odometry.len() + 1);
        if next < poses.len() {
            return Err(G2oError(format!(
                "there is no edge from vertex {last} to the next one, {next}: a trajectory needs odometry between all its keyframes"
            )));
        }
        odometry.extend(loops);
        Ok(Self {
            poses,
            constraints: odometry,
        })
    }

    /// Returns the text of a g2o file with these poses and constraints. Groups and kinds of
    /// constraints are not part of the format.
    pub fn write(poses: &[Pose], constraints: impl IntoIterator<Item = Constraint>) -> String {
        let mut text = String::new();
        for (id, pose) in poses.iter().enumerate() {
            let [x, y, yaw] = xy_yaw(pose);
            line(&mut text, format_args!("VERTEX_SE2 {id} {x} {y} {yaw}"));
        }
        for Constraint {
            from, to, motion, ..
        } in constraints
        {
            let [x, y, yaw] = xy_yaw(&motion.motion);
            let axes = axes(&motion.motion);
            let covariance = axes.transpose() * motion.covariance * axes;
            let information = covariance
                .cholesky()
                .map_or(Matrix3::zeros(), |factor| factor.inverse());
            let [xx, xy, xyaw, yy, yyaw, yawyaw] = pack(&information);
            line(
                &mut text,
                format_args!(
                    "EDGE_SE2 {from} {to} {x} {y} {yaw} {xx} {xy} {xyaw} {yy} {yyaw} {yawyaw}"
                ),
            );
        }
        // GTSAM reads no edge behind a line that is neither a vertex nor an edge.
        line(&mut text, format_args!("FIX 0"));
        text
    }
}

fn line(text: &mut String, content: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{content}");
}

/// Returns the number of loops without the fixes that a comment counts.
fn fixes_before(comment: &str, loops: usize) -> Result<usize, String> {
    let count = comment.split(':').next().unwrap_or_default().trim();
    let left = count.parse().ok().and_then(|it| loops.checked_sub(it));
    left.ok_or_else(|| format!("{loops} edges that are no odometry are before {count:?} fixes"))
}

/// Returns the matrix that turns (x, y, yaw) along the axes of the keyframe `to` into (x, y, yaw)
/// along the axes of `from`.
fn axes(motion: &Pose) -> Matrix3<f64> {
    motion.rotation.to_rotation_matrix().to_homogeneous()
}

/// Returns the ends and the motion of an edge between so many vertices.
fn edge<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices: usize,
) -> Result<([usize; 2], UncertainMotion), String> {
    let needed = "EDGE_SE2 needs two ids, x, y, yaw and the six values of the upper triangle of the information matrix";
    let ([from, to], [x, y, yaw, information @ ..]) = fields::<2, 9>(words, needed)?;
    let later = from.max(to);
    if later >= vertices {
        return Err(format!("vertex {later} is not in the file"));
    }
    let factor = unpack(&information).cholesky().ok_or_else(|| {
        format!("the information matrix of the edge from {from} to {to} is not positive definite")
    })?;
    let (motion, covariance) = (pose(x, y, yaw), factor.inverse());
    let axes = axes(&motion);
    let covariance = axes * covariance * axes.transpose();
    Ok(([from, to], UncertainMotion { motion, covariance }))
}

/// Returns ids and numbers; the error names `needed`.
fn fields<'a, const IDS: usize, const NUMBERS: usize>(
    words: impl Iterator<Item = &'a str>,
    needed: &str,
) -> Result<([usize; IDS], [f64; NUMBERS]), String> {
    let words: Vec<_> = words.collect();
    let read = || {
        let (ids, numbers) = words.split_at_checked(IDS)?;
        let ids: Option<Vec<usize>> = ids.iter().map(|word| word.parse().ok()).collect();
        let finite = |word: &&str| word.parse().ok().filter(|number: &f64| number.is_finite());
        let numbers: Option<Vec<f64>> = numbers.iter().map(finite).collect();
        let ids: [usize; IDS] = ids?.try_into().ok()?;
        let numbers: [f64; NUMBERS] = numbers?.try_into().ok()?;
        Some((ids, numbers))
    };
    read().ok_or_else(|| format!("{needed}, each a finite number"))
}
