//! The trajectory as it is drawn: fewer vertices where it is long.

use gyre_contract::PoseHeader;
use serde::Serialize;

/// The most vertices. With one more, the distance between them doubles.
const MAX_VERTICES: usize = 4000;
/// The first distance between two vertices, m.
const SPACING_M: f64 = 0.25;
const TURN_RAD: f64 = 0.1;

/// A pose: x, y (m), yaw (rad), and the covariance of the position: xx, xy, yy (m^2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Vertex(pub [f64; 6]);

#[derive(Debug)]
pub struct Track {
    vertices: Vec<Vertex>,
    spacing_m: f64,
    length_m: f64,
    last: Option<Vertex>,
    /// Counts how often the vertices were replaced by others.
    version: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cursor {
    version: u64,
    vertices: usize,
}

impl Vertex {
    pub fn of(pose: &PoseHeader) -> Self {
        let [xx, xy, _, yy, _, _] = pose.covariance;
        Self([pose.x_m, pose.y_m, pose.yaw_rad, xx, xy, yy])
    }

    fn distance_m(&self, other: &Self) -> f64 {
        (self.0[0] - other.0[0]).hypot(self.0[1] - other.0[1])
    }

    fn turn_rad(&self, other: &Self) -> f64 {
        let turn = self.0[2] - other.0[2];
        turn.sin().atan2(turn.cos()).abs()
    }
}

impl Default for Track {
    fn default() -> Self {
        Self {
            vertices: Vec::new(),
            spacing_m: SPACING_M,
            length_m: 0.0,
            last: None,
            version: 1,
        }
    }
}

impl Track {
    /// Adds a pose; it becomes a vertex if it is far enough from the last one.
    pub fn add(&mut self, pose: &PoseHeader) {
        let vertex = Vertex::of(pose);
        self.length_m += self.last.map_or(0.0, |last| last.distance_m(&vertex));
        self.last = Some(vertex);
        let is_near = |before: &Vertex| {
            before.distance_m(&vertex) < self.spacing_m
                && (before.turn_rad(&vertex) < TURN_RAD || self.spacing_m > SPACING_M)
        };
        if self.vertices.last().is_some_and(is_near) {
            return;
        }
        self.vertices.push(vertex);
        if self.vertices.len() > MAX_VERTICES {
            self.thin();
        }
    }

    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Returns the vertices that are new to a reader, and whether they replace the received ones.
    pub fn since(&self, cursor: &mut Cursor) -> (&[Vertex], bool) {
        let replaces = cursor.version != self.version;
        let first = if replaces { 0 } else { cursor.vertices };
        *cursor = Cursor {
            version: self.version,
            vertices: self.vertices.len(),
        };
        (&self.vertices[first..], replaces)
    }

    pub fn clear(&mut self) {
        *self = Self {
            version: self.version + 1,
            ..Self::default()
        };
    }

    /// Leaves out vertices, evenly along the way, until half of them remain.
    fn thin(&mut self) {
        while self.vertices.len() > MAX_VERTICES / 2 {
            self.spacing_m *= 2.0;
            let spacing_m = self.spacing_m;
            let mut kept: Option<Vertex> = None;
            self.vertices.retain(|vertex| {
                let is_far = kept.is_none_or(|kept| kept.distance_m(vertex) >= spacing_m);
                if is_far {
                    kept = Some(*vertex);
                }
                is_far
            });
        }
        self.version += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x_m: f64, yaw_rad: f64) -> PoseHeader {
        PoseHeader {
            x_m,
            yaw_rad,
            ..PoseHeader::default()
        }
    }

    #[test]
    fn a_reader_receives_each_vertex_once() {
        let mut track = Track::default();
        let mut cursor = Cursor::default();
        track.add(&at(0.0, 0.0));
        assert!(track.since(&mut cursor).1);
        track.add(&at(0.1, 0.0));
        assert!(track.since(&mut cursor).0.is_empty());
        track.add(&at(0.1, 0.2));
        track.add(&at(1.0, 0.2));
        let (new, replaces) = track.since(&mut cursor);
        assert_eq!((new.len(), replaces), (2, false));
        assert!((track.length_m() - 1.0).abs() < 1e-12);
        track.clear();
        assert_eq!(track.since(&mut cursor), (&[][..], true));
    }

    #[test]
    fn a_long_drive_keeps_its_shape_in_a_bounded_number_of_vertices() {
        let mut track = Track::default();
        let mut cursor = Cursor::default();
        for metre in 0..100_000 {
            track.add(&at(f64::from(metre), 0.0));
        }
        let (all, replaces) = track.since(&mut cursor);
        assert!(replaces && all.len() <= MAX_VERTICES && all.len() > MAX_VERTICES / 5);
        let gaps = all.windows(2).map(|pair| pair[0].distance_m(&pair[1]));
        assert!(gaps.fold(0.0, f64::max) <= 4.0 * 100_000.0 / MAX_VERTICES as f64);
        assert_eq!(all[0].0[0], 0.0);
    }
}
