//! Sparse Cholesky factorisation of a symmetric matrix of 3 x 3 blocks, row by row (Davis, Direct
//! Methods for Sparse Linear Systems, Sec. 4.7), in an order of approximate minimum degree.

use std::collections::TryReserveError;

use nalgebra::{DVector, Matrix3, SMatrix, Vector3};

/// The factor L of P H P' = L L', where P orders the blocks by elimination.
pub(super) struct Cholesky {
    /// The block of the matrix that each step eliminates.
    order: Vec<usize>,
    /// Of each step: the blocks of the matrix that share an edge with its block and are eliminated
    /// before.
    left: Lists<Entry>,
    /// Of each row of the factor: the columns of its blocks, ascending.
    columns: Lists<usize>,
    /// Of each column of the factor: the rows of its blocks below the diagonal, ascending.
    rows: Lists<usize>,
    below: Vec<Matrix3<f64>>,
    diagonal: Vec<Matrix3<f64>>,
    /// A row of the matrix, transposed; zero between the steps.
    row: Vec<Matrix3<f64>>,
}

/// A block of the matrix, left of the diagonal in the order of elimination.
struct Entry {
    column: usize,
    number: usize,
    /// The block is stored with its row as the column.
    is_transposed: bool,
}

struct Lists<T> {
    starts: Vec<usize>,
    items: Vec<T>,
}

impl<T> Lists<T> {
    fn of(&self, list: usize) -> &[T] {
        &self.items[self.starts[list]..self.starts[list + 1]]
    }
}

impl Cholesky {
    /// Finds the structure of the factor of a matrix of `blocks` x `blocks` blocks, where `pairs`
    /// are not zero: columns and rows below the diagonal, sorted.
    pub fn new(blocks: usize, pairs: &[[usize; 2]]) -> Result<Self, TryReserveError> {
        let [order, place] = elimination_order(blocks, pairs);
        let left = left_of_diagonal(pairs, &place);
        let columns = fill(&left);
        let rows = transpose(&columns);
        let mut below = Vec::new();
        below.try_reserve_exact(rows.items.len())?;
        below.resize(rows.items.len(), Matrix3::zeros());
        Ok(Self {
            order,
            left,
            columns,
            rows,
            below,
            diagonal: vec![Matrix3::zeros(); blocks],
            row: vec![Matrix3::zeros(); blocks],
        })
    }

    /// Factorises the matrix with these blocks on the diagonal and below. Returns whether it is
    /// positive definite.
    pub fn factorise(&mut self, diagonal: &[Matrix3<f64>], below: &[Matrix3<f64>]) -> bool {
        let mut ends = self.rows.starts.clone();
        for step in 0..self.order.len() {
            for entry in self.left.of(step) {
                let block = &below[entry.number];
                self.row[entry.column] = match entry.is_transposed {
                    true => block.transpose(),
                    false => *block,
                };
            }
            let pivot = self.eliminate(step, diagonal[self.order[step]], &mut ends);
            let Some(pivot) = pivot.cholesky() else {
                self.row.fill(Matrix3::zeros());
                return false;
            };
            self.diagonal[step] = pivot.unpack();
        }
        true
    }

    /// Computes a row of the factor from the row of the matrix, and returns what remains of its
    /// block on the diagonal. `ends` are the ends of the columns so far.
    fn eliminate(
        &mut self,
        step: usize,
        mut pivot: Matrix3<f64>,
        ends: &mut [usize],
    ) -> Matrix3<f64> {
        for &column in self.columns.of(step) {
            let block = std::mem::take(&mut self.row[column]);
            let block = solve_lower(&self.diagonal[column], &block);
            let (start, end) = (self.rows.starts[column], ends[column]);
            let above = self.rows.items[start..end].iter();
            for (&row, factor) in above.zip(&self.below[start..end]) {
                self.row[row] -= factor * block;
            }
            let transposed = block.transpose();
            pivot -= transposed * block;
            self.below[end] = transposed;
            ends[column] += 1;
        }
        pivot
    }

    pub fn solve(&self, side: &mut DVector<f64>) {
        let block = |of: usize| side.fixed_rows::<3>(3 * of).into_owned();
        let mut solved: Vec<_> = self.order.iter().map(|&of| block(of)).collect();
        for column in 0..solved.len() {
            // The side of a covariance is zero but for one block.
            if solved[column] == Vector3::zeros() {
                continue;
            }
            let known = solve_lower(&self.diagonal[column], &solved[column]);
            solved[column] = known;
            for (row, factor) in self.column(column) {
                solved[row] -= factor * known;
            }
        }
        for column in (0..solved.len()).rev() {
            let mut sum = solved[column];
            for (row, factor) in self.column(column) {
                sum -= factor.tr_mul(&solved[row]);
            }
            solved[column] = solve_upper(&self.diagonal[column], &sum);
        }
        for (&of, solved) in self.order.iter().zip(&solved) {
            side.fixed_rows_mut::<3>(3 * of).copy_from(solved);
        }
    }

    fn column(&self, column: usize) -> impl Iterator<Item = (usize, &Matrix3<f64>)> {
        let blocks = &self.below[self.rows.starts[column]..self.rows.starts[column + 1]];
        self.rows.of(column).iter().copied().zip(blocks)
    }
}

fn starts(count: usize, lists: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut starts = vec![0; count + 1];
    lists.for_each(|list| starts[list + 1] += 1);
    (0..count).for_each(|list| starts[list + 1] += starts[list]);
    starts
}

/// Returns an order of elimination that keeps the factor sparse, and its inverse.
fn elimination_order(blocks: usize, pairs: &[[usize; 2]]) -> [Vec<usize>; 2] {
    // With the diagonal: the crate takes a pattern for having at least one entry a column.
    let mut pattern: Vec<_> = (0..blocks)
        .map(|of| [of, of])
        .chain(pairs.to_vec())
        .collect();
    pattern.sort_unstable();
    let starts = starts(blocks, pattern.iter().map(|[column, _]| *column));
    let rows: Vec<_> = pattern.iter().map(|[_, row]| *row).collect();
    match amd::order(blocks, &starts, &rows, &amd::Control::default()) {
        Ok((order, place, _)) => [order, place],
        // Invalid patterns are rejected. Every order is right, and this one needs more memory.
        Err(_) => [(0..blocks).collect(), (0..blocks).collect()],
    }
}

fn left_of_diagonal(pairs: &[[usize; 2]], place: &[usize]) -> Lists<Entry> {
    let mut entries: Vec<_> = pairs
        .iter()
        .enumerate()
        .map(|(number, &[column, row])| {
            let (column, row) = (place[column], place[row]);
            let entry = Entry {
                column: column.min(row),
                number,
                is_transposed: column < row,
            };
            (column.max(row), entry)
        })
        .collect();
    entries.sort_by_key(|(row, entry)| (*row, entry.column));
    Lists {
        starts: starts(place.len(), entries.iter().map(|(row, _)| *row)),
        items: entries.into_iter().map(|(_, entry)| entry).collect(),
    }
}

/// Returns the columns of each row of the factor: the columns of the matrix, and from each of them
/// all up the elimination tree.
fn fill(left: &Lists<Entry>) -> Lists<usize> {
    let steps = left.starts.len() - 1;
    let mut parents = vec![usize::MAX; steps];
    let mut reached: Vec<_> = (0..steps).collect();
    let (mut starts, mut items) = (vec![0], Vec::new());
    for row in 0..steps {
        let start = items.len();
        for entry in left.of(row) {
            let mut column = entry.column;
            while reached[column] != row {
                reached[column] = row;
                items.push(column);
                if parents[column] == usize::MAX {
                    parents[column] = row;
                }
                column = parents[column];
            }
        }
        items[start..].sort_unstable();
        starts.push(items.len());
    }
    Lists { starts, items }
}

fn transpose(columns: &Lists<usize>) -> Lists<usize> {
    let count = columns.starts.len() - 1;
    let starts = starts(count, columns.items.iter().copied());
    let (mut ends, mut items) = (starts.clone(), vec![0; columns.items.len()]);
    for row in 0..count {
        for &column in columns.of(row) {
            items[ends[column]] = row;
            ends[column] += 1;
        }
    }
    Lists { starts, items }
}

/// Solves L x = b for each column of b.
fn solve_lower<const C: usize>(l: &Matrix3<f64>, b: &SMatrix<f64, 3, C>) -> SMatrix<f64, 3, C> {
    let mut solved = *b;
    for mut x in solved.column_iter_mut() {
        x[0] /= l.m11;
        x[1] = (x[1] - l.m21 * x[0]) / l.m22;
        x[2] = (x[2] - l.m31 * x[0] - l.m32 * x[1]) / l.m33;
    }
    solved
}

/// Solves L' x = b.
fn solve_upper(l: &Matrix3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    let z = b.z / l.m33;
    let y = (b.y - l.m32 * z) / l.m22;
    Vector3::new((b.x - l.m21 * y - l.m31 * z) / l.m11, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused_and_leaves_no_trace() {
        let mut factor = Cholesky::new(2, &[[0, 1]]).unwrap();
        let block = |scale: f64| Matrix3::identity() * scale;
        assert!(!factor.factorise(&[block(2.0), block(-2.0)], &[block(0.5)]));
        assert!(!factor.factorise(&[block(-2.0), block(2.0)], &[block(0.5)]));
        assert!(factor.factorise(&[block(2.0), block(2.0)], &[block(0.5)]));
        let mut side = DVector::from_element(6, 1.0);
        factor.solve(&mut side);
        assert!((side - DVector::from_element(6, 0.4)).amax() < 1e-12);
    }
}
