//! Pose graphs as g2o files: `VERTEX_SE2`, `EDGE_SE2` and `FIX` of the first vertex.
//!
//! The error of a g2o edge lies along the axes of the keyframe `to` as measured, with an
//! information matrix; the error of a [`Constraint`] along the axes of `from`, with a covariance.
//! The first edge from each keyframe to the next one is read as odometry, all others as independent
//! loops.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use gyre_geometry::covariance::{pack, unpack};
use gyre_geometry::{Pose, UncertainMotion, pose, xy_yaw};
use nalgebra::Matrix3;
use thiserror::Error;

use crate::Constraint;

/// The content of a g2o file. Keyframes are the vertices in the order of their ids.
#[derive(Debug, Clone, PartialEq)]
pub struct G2o {
    /// The vertices: the poses of all keyframes. Empty if the file has edges alone.
    pub poses: Vec<Pose>,
    /// The edges: odometry in the order of the keyframes, then loops in the order of the file.
    pub constraints: Vec<Constraint>,
}

/// The reason why a text is refused, with its line, counted from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct G2oError(String);

impl G2oError {
    fn at(line: usize, reason: impl std::fmt::Display) -> Self {
        Self(format!("line {line}: {reason}"))
    }
}

struct RawEdge {
    line: usize,
    ends: [u64; 2],
    motion: UncertainMotion,
}

#[derive(Default)]
struct Raw {
    vertices: BTreeMap<u64, Pose>,
    edges: Vec<RawEdge>,
    fixed: Vec<(usize, u64)>,
}

impl G2o {
    pub fn parse(text: &str) -> Result<Self, G2oError> {
        let mut raw = Raw::default();
        for (number, line) in text.lines().enumerate() {
            raw.read(number + 1, line)?;
        }
        raw.resolve()
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

/// Returns the matrix that turns (x, y, yaw) along the axes of the keyframe `to` into (x, y, yaw)
/// along the axes of `from`.
fn axes(motion: &Pose) -> Matrix3<f64> {
    motion.rotation.to_rotation_matrix().to_homogeneous()
}

impl Raw {
    fn read(&mut self, line: usize, text: &str) -> Result<(), G2oError> {
        let mut words = text.split_whitespace();
        match words.next() {
            None => {}
            Some(comment) if comment.starts_with('#') => {}
            Some("VERTEX_SE2") => {
                let needed = "an id, x, y and yaw";
                let ([id], [x, y, yaw]) = fields(words, line, "VERTEX_SE2", needed)?;
                if self.vertices.insert(id, pose(x, y, yaw)).is_some() {
                    let reason = format!("vertex {id} appears a second time");
                    return Err(G2oError::at(line, reason));
                }
            }
            Some("EDGE_SE2") => {
                let needed = "two ids, x, y, yaw and the six values of the upper triangle of the information matrix";
                let (ends, [x, y, yaw, information @ ..]) =
                    fields::<2, 9>(words, line, "EDGE_SE2", needed)?;
                let motion = pose(x, y, yaw);
                let [from, to] = ends;
                let Some(factor) = unpack(&information).cholesky() else {
                    let reason = format!(
                        "the information matrix of the edge from {from} to {to} is not positive definite"
                    );
                    return Err(G2oError::at(line, reason));
                };
                let covariance = factor.inverse();
                let axes = axes(&motion);
                let motion = UncertainMotion {
                    motion,
                    covariance: axes * covariance * axes.transpose(),
                };
                self.edges.push(RawEdge { line, ends, motion });
            }
            Some("FIX") => {
                let ([id], []) = fields(words, line, "FIX", "an id")?;
                self.fixed.push((line, id));
            }
            Some(tag) => {
                return Err(G2oError::at(
                    line,
                    format!(
                        "{tag:?} is not read, only VERTEX_SE2, EDGE_SE2, FIX of the first vertex, and comments"
                    ),
                ));
            }
        }
        Ok(())
    }

    fn resolve(self) -> Result<G2o, G2oError> {
        if self.edges.is_empty() {
            return Err(G2oError("there is no EDGE_SE2".to_owned()));
        }
        let ids: BTreeSet<u64> = match self.vertices.is_empty() {
            true => self.edges.iter().flat_map(|edge| edge.ends).collect(),
            false => self.vertices.keys().copied().collect(),
        };
        let keyframes: BTreeMap<u64, usize> = ids.iter().copied().zip(0..).collect();
        for (line, id) in self.fixed {
            if keyframes.get(&id) != Some(&0) {
                let reason = format!("vertex {id} is fixed, but only the first vertex can be");
                return Err(G2oError::at(line, reason));
            }
        }
        let mut odometry: Vec<Option<Constraint>> = vec![None; ids.len() - 1];
        let mut loops = Vec::new();
        for RawEdge { line, ends, motion } in self.edges {
            let keyframe = |id| {
                let missing = || G2oError::at(line, format!("vertex {id} is not in the file"));
                keyframes.get(&id).copied().ok_or_else(missing)
            };
            let (from, to) = (keyframe(ends[0])?, keyframe(ends[1])?);
            match odometry.get_mut(from) {
                Some(empty @ None) if to == from + 1 => {
                    *empty = Some(Constraint::odometry(from, motion));
                }
                _ => loops.push(Constraint::closing(from, to, motion)),
            }
        }
        let ids: Vec<u64> = ids.into_iter().collect();
        let gap = |k: usize| {
            let (from, to) = (ids[k], ids[k + 1]);
            G2oError(format!(
                "there is no edge from vertex {from} to the next one, {to}: a trajectory needs odometry between all its keyframes"
            ))
        };
        let odometry = odometry.into_iter().enumerate();
        let odometry = odometry.map(|(k, constraint)| constraint.ok_or_else(|| gap(k)));
        let mut constraints: Vec<_> = odometry.collect::<Result<_, _>>()?;
        constraints.extend(loops);
        Ok(G2o {
            poses: self.vertices.into_values().collect(),
            constraints,
        })
    }
}

fn fields<'a, const IDS: usize, const NUMBERS: usize>(
    words: impl Iterator<Item = &'a str>,
    line: usize,
    tag: &str,
    needed: &str,
) -> Result<([u64; IDS], [f64; NUMBERS]), G2oError> {
    let words: Vec<_> = words.collect();
    let wrong = || {
        let reason = format!("{tag} needs {needed}, each a finite number");
        G2oError::at(line, reason)
    };
    let (ids, numbers) = words.split_at_checked(IDS).ok_or_else(wrong)?;
    let ids: Option<Vec<u64>> = ids.iter().map(|word| word.parse().ok()).collect();
    let finite = |word: &&str| word.parse().ok().filter(|number: &f64| number.is_finite());
    let numbers: Option<Vec<f64>> = numbers.iter().map(finite).collect();
    let ids = ids.and_then(|ids| ids.try_into().ok()).ok_or_else(wrong)?;
    let numbers = numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(wrong)?;
    Ok((ids, numbers))
}
