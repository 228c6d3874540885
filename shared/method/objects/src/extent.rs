//! Length and width of an object, and its centre by what is seen of it.
//!
//! A radar sees the ends of a vehicle, in one scan the near one, in another both, and at times only
//! the far one: the centre is half of the length behind the one, or before the other, and what is
//! seen is what fits the prediction. Length and width begin as those of a car, and grow with what
//! is seen.

use nalgebra::{Point2, Vector2};

use crate::returns::Return;

/// Length and width of a car, m.
const CAR_M: [f64; 2] = [4.4, 1.9];
/// Length and width of the largest vehicle, an articulated lorry or bus, m.
const LARGEST_M: [f64; 2] = [18.0, 2.6];
/// Share of the returns at either end that is left out.
const TRIM: f64 = 0.05;
/// Shares by which length and width approach what is seen in a scan, if that is more and if it is
/// less.
const GAIN: [f64; 2] = [0.3, 0.1];
/// Share of the size that is missing from which on only one end is seen, and says nothing about it.
const ONE_END: f64 = 0.35;
/// Length and width of the smallest vehicle, m.
const SMALLEST_M: [f64; 2] = [4.0, 1.7];
/// Distance from the prediction by which the near end is preferred to the far one and the whole, m.
const DOUBT_M: f64 = 1.0;
/// Cosine between the line of sight and an axis above which one end of the object is nearer.
const END_ON: f64 = 0.35;

/// The length and the width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Along the heading and across it, m.
    pub size_m: [f64; 2],
}

/// An object as a scan shows it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    /// From one end to the other, along the heading and across it, relative to the centre as
    /// predicted, m.
    spans_m: [[f64; 2]; 2],
}

impl Extent {
    /// That of a car.
    pub fn car() -> Self {
        Self { size_m: CAR_M }
    }

    /// Returns the outline of some returns, seen from a heading, relative to a centre.
    pub fn outline(
        returns: &[Return],
        members: &[u32],
        (centre, velocity): (&Point2<f64>, &Vector2<f64>),
        heading: &Vector2<f64>,
    ) -> Outline {
        let side = Vector2::new(-heading.y, heading.x);
        let mut along = Vec::with_capacity(members.len());
        let mut across = Vec::with_capacity(members.len());
        for member in members {
            let at = returns[*member as usize].at_scan(velocity) - centre;
            along.push(at.dot(heading));
            across.push(at.dot(&side));
        }
        Outline {
            spans_m: [trimmed_span(along), trimmed_span(across)],
        }
    }

    /// Returns how far the centre of the object is from the one that the outline is relative to, m.
    /// `direction` is the line of sight, a unit vector.
    pub fn centre(
        &self,
        outline: &Outline,
        heading: &Vector2<f64>,
        direction: &Vector2<f64>,
    ) -> Vector2<f64> {
        let side = Vector2::new(-heading.y, heading.x);
        let mut centre = Vector2::zeros();
        for (axis, towards) in [*heading, side].iter().enumerate() {
            let [low, high] = outline.spans_m[axis];
            let hidden_m = (self.size_m[axis] - (high - low)).max(0.0);
            let middle = 0.5 * (low + high);
            // What is seen is the near end, or the far one, or the whole: that which is nearest to
            // the prediction, and rather the near end.
            let end_on = (towards.dot(direction) / END_ON).clamp(-1.0, 1.0);
            let near = middle + 0.5 * end_on * hidden_m;
            let far = middle - 0.5 * end_on * hidden_m;
            let choices = [(near, 0.0), (middle, DOUBT_M), (far, DOUBT_M)];
            let cost = |(at, doubt): &(f64, f64)| at.abs() + doubt;
            let best = choices.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
            centre += towards * best.map_or(middle, |best| best.0);
        }
        centre
    }

    /// Takes what a scan shows.
    pub fn update(&mut self, outline: &Outline) {
        for axis in 0..2 {
            let [low, high] = outline.spans_m[axis];
            let excess_m = (high - low) - self.size_m[axis];
            let gain = match excess_m / self.size_m[axis] {
                excess if excess > 0.0 => GAIN[0],
                excess if excess > -ONE_END => GAIN[1],
                _ => 0.0,
            };
            let size_m = self.size_m[axis] + gain * excess_m;
            self.size_m[axis] = size_m.clamp(SMALLEST_M[axis], LARGEST_M[axis]);
        }
    }
}

/// The span of some values without those at its ends.
fn trimmed_span(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let trimmed = (TRIM * last as f64).round() as usize;
    let at = |index: usize| values.get(index).copied().unwrap_or_default();
    [at(trimmed), at(last - trimmed)]
}
