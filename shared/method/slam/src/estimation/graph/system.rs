use std::collections::TryReserveError;

use nalgebra::{DVector, Matrix3};

use super::{
    cholesky::Cholesky,
    edge::{Ends, Linear},
};

/// A symmetric system of equations with three rows a pose and a block for each pair of poses that
/// share an edge; only the lower triangle is stored. Pose 0 is fixed and has no rows.
pub(super) struct System {
    /// Of each edge in the order given: the number of the block below the diagonal. `None` for an
    /// edge of pose 0.
    numbers: Vec<Option<usize>>,
    pairs: Vec<[usize; 2]>,
    below: Vec<Matrix3<f64>>,
    diagonal: Vec<Matrix3<f64>>,
    factor: Cholesky,
}

impl System {
    /// Finds the structure of the matrix and of its factor.
    pub fn new(poses: usize, edges: &[Ends]) -> Result<Self, TryReserveError> {
        let blocks = poses - 1;
        let of_edges: Vec<_> = edges.iter().map(pair).collect();
        let mut pairs: Vec<_> = of_edges.iter().flatten().copied().collect();
        pairs.sort_unstable();
        pairs.dedup();
        let number = |pair| pairs.partition_point(|other| *other < pair);
        let numbers = of_edges.into_iter().map(|pair| pair.map(number));
        Ok(Self {
            numbers: numbers.collect(),
            below: vec![Matrix3::zeros(); pairs.len()],
            diagonal: vec![Matrix3::zeros(); blocks],
            factor: Cholesky::new(blocks, &pairs)?,
            pairs,
        })
    }

    pub fn right_hand_side(&self) -> DVector<f64> {
        DVector::zeros(3 * self.diagonal.len())
    }

    pub fn row(pose: usize) -> Option<usize> {
        Some(3 * pose.checked_sub(1)?)
    }

    pub fn clear(&mut self) {
        self.below.fill(Matrix3::zeros());
        self.diagonal.fill(Matrix3::zeros());
    }

    /// Adds an edge to the equations, times `weight`.
    pub fn add(
        &mut self,
        edge: usize,
        ends: Ends,
        linear: &Linear,
        weight: f64,
        side: &mut DVector<f64>,
    ) {
        for (end, pose) in ends.into_iter().enumerate() {
            let Some(row) = Self::row(pose) else { continue };
            let mut side = side.fixed_rows_mut::<3>(row);
            side += weight * linear.sides[end];
            self.diagonal[pose - 1] += weight * linear.blocks[end];
        }
        if let Some(number) = self.numbers[edge] {
            self.below[number] += match ends[0] < ends[1] {
                true => weight * linear.between.transpose(),
                false => weight * linear.between,
            };
        }
    }

    pub fn factorise(&mut self) -> bool {
        self.factor.factorise(&self.diagonal, &self.below)
    }

    /// Returns v' H v of a vector v and the matrix H.
    pub fn quadratic_form(&self, vector: &DVector<f64>) -> f64 {
        let of = |block: usize| vector.fixed_rows::<3>(3 * block);
        let diagonal = self.diagonal.iter().enumerate();
        let diagonal = diagonal.map(|(block, value)| of(block).dot(&(value * of(block))));
        let below = self.pairs.iter().zip(&self.below);
        let below = below.map(|(&[column, row], value)| of(row).dot(&(value * of(column))));
        diagonal.sum::<f64>() + 2.0 * below.sum::<f64>()
    }

    pub fn solve(&self, side: &mut DVector<f64>) {
        self.factor.solve(side);
    }
}

/// Returns the column and the row of the block of an edge below the diagonal; `None` for an edge of
/// pose 0.
fn pair(&[a, b]: &Ends) -> Option<[usize; 2]> {
    Some([a.min(b).checked_sub(1)?, a.max(b) - 1])
}
