//! The normal equations of a pose graph, and their sparse Cholesky factorisation.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par, Side};

use super::edge::{Ends, Linear};

/// A symmetric system of equations with three rows a pose and a block for each pair of poses that
/// share an edge, of which the lower triangle is stored. Pose 0 is fixed and has no rows.
pub(super) struct System {
    /// Of each edge in the order given: the block below the diagonal, as its column and its number
    /// within the column. `None` for an edge of pose 0.
    slots: Vec<Option<[usize; 2]>>,
    columns: Vec<usize>,
    rows: Vec<usize>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl System {
    /// Finds the structure of the matrix and of its factor.
    pub fn new(poses: usize, edges: &[Ends]) -> Result<Self, FaerError> {
        let blocks = poses - 1;
        let below: Vec<_> = edges.iter().map(below).collect();
        let pattern = Pattern::new(blocks, &below);
        let [order, place] = pattern.elimination_order()?;
        let (columns, rows) = pattern.scalars();
        let size = 3 * blocks;
        let symbolic = factorize_symbolic_cholesky(
            SymbolicSparseColMatRef::new_checked(size, size, &columns, None, &rows),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&order, &place, size)),
            CholeskySymbolicParams::default(),
        )?;
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let slot = |block: Option<[usize; 2]>| block.map(|block| pattern.slot(block));
        Ok(Self {
            slots: below.into_iter().map(slot).collect(),
            values: vec![0.0; rows.len()],
            columns,
            rows,
            factor: vec![0.0; symbolic.len_val()],
            memory: MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?,
            symbolic,
        })
    }

    /// Returns a right-hand side of zeros with `columns` columns.
    pub fn right_hand_side(&self, columns: usize) -> Mat<f64> {
        Mat::zeros(self.columns.len() - 1, columns)
    }

    /// Returns the first row of a pose; `None` for pose 0.
    pub fn row(pose: usize) -> Option<usize> {
        Some(3 * pose.checked_sub(1)?)
    }

    /// Sets the matrix to zero.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds what an edge adds to the equations, times `weight`.
    pub fn add(
        &mut self,
        edge: usize,
        ends: Ends,
        linear: &Linear,
        weight: f64,
        sides: &mut Mat<f64>,
    ) {
        let rows = ends.map(Self::row);
        for (end, row) in rows.into_iter().enumerate() {
            let Some(row) = row else { continue };
            for axis in 0..3 {
                sides[(row + axis, 0)] += weight * linear.sides[end][axis];
                let from = self.columns[row + axis];
                for below in axis..3 {
                    self.values[from + below - axis] += weight * linear.blocks[end][(below, axis)];
                }
            }
        }
        let Some([column, number]) = self.slots[edge] else {
            return;
        };
        let first_is_column = rows[0] == Some(3 * column);
        for axis in 0..3 {
            let from = self.columns[3 * column + axis] + 3 - axis + 3 * number;
            for row in 0..3 {
                let at = if first_is_column {
                    (axis, row)
                } else {
                    (row, axis)
                };
                self.values[from + row] += weight * linear.between[at];
            }
        }
    }

    /// Factorises the matrix. Returns whether it is positive definite.
    pub fn factorise(&mut self) -> bool {
        let size = self.columns.len() - 1;
        let pattern =
            SymbolicSparseColMatRef::new_checked(size, size, &self.columns, None, &self.rows);
        let done = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            SparseColMatRef::new(pattern, &self.values),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut self.memory),
            Default::default(),
        );
        done.is_ok()
    }

    /// Returns v' H v of a vector v and the matrix H.
    pub fn quadratic_form(&self, vector: &Mat<f64>) -> f64 {
        let size = self.columns.len() - 1;
        let of_column = |column: usize| {
            let entries = self.columns[column] + 1..self.columns[column + 1];
            let below = entries.map(|at| self.values[at] * vector[(self.rows[at], 0)]);
            let diagonal = self.values[self.columns[column]] * vector[(column, 0)];
            vector[(column, 0)] * (diagonal + 2.0 * below.sum::<f64>())
        };
        (0..size).map(of_column).sum()
    }

    /// Solves the factorised equations in place.
    pub fn solve(&self, sides: &mut Mat<f64>) {
        let scratch = self
            .symbolic
            .solve_in_place_scratch::<f64>(sides.ncols(), Par::Seq);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            sides.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}

/// Returns the column and the row of the block of an edge below the diagonal; `None` for an edge of
/// pose 0.
fn below(&[a, b]: &Ends) -> Option<[usize; 2]> {
    Some([a.min(b).checked_sub(1)?, a.max(b) - 1])
}

/// The blocks below the diagonal, by columns.
struct Pattern {
    columns: Vec<usize>,
    rows: Vec<usize>,
}

impl Pattern {
    fn new(blocks: usize, below: &[Option<[usize; 2]>]) -> Self {
        let mut below: Vec<_> = below.iter().flatten().copied().collect();
        below.sort_unstable();
        below.dedup();
        let mut columns = vec![0; blocks + 1];
        for [column, _] in &below {
            columns[column + 1] += 1;
        }
        for column in 0..blocks {
            columns[column + 1] += columns[column];
        }
        let rows = below.into_iter().map(|[_, row]| row).collect();
        Self { columns, rows }
    }

    fn column(&self, column: usize) -> &[usize] {
        &self.rows[self.columns[column]..self.columns[column + 1]]
    }

    /// Returns the column of a block and its number within the column.
    fn slot(&self, [column, row]: [usize; 2]) -> [usize; 2] {
        [column, self.column(column).partition_point(|&r| r < row)]
    }

    /// Returns an order of elimination of the single rows that keeps the factor sparse (approximate
    /// minimum degree of the blocks), and its inverse.
    fn elimination_order(&self) -> Result<[Vec<usize>; 2], FaerError> {
        let blocks = self.columns.len() - 1;
        let (columns, rows) = (&self.columns, &self.rows);
        let pattern = SymbolicSparseColMatRef::new_checked(blocks, blocks, columns, None, rows);
        let (mut order, mut place) = (vec![0; blocks], vec![0; blocks]);
        let scratch = amd::order_scratch::<usize>(blocks, rows.len());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?;
        let stack = MemStack::new(&mut memory);
        amd::order(
            &mut order,
            &mut place,
            pattern,
            amd::Control::default(),
            stack,
        )?;
        let single =
            |blocks: Vec<usize>| blocks.into_iter().flat_map(|b| 3 * b..3 * b + 3).collect();
        Ok([single(order), single(place)])
    }

    /// Returns the pattern of the single values, with the lower triangles of the diagonal blocks.
    fn scalars(&self) -> (Vec<usize>, Vec<usize>) {
        let (mut columns, mut rows) = (vec![0], Vec::new());
        for column in 0..self.columns.len() - 1 {
            for axis in 0..3 {
                rows.extend(3 * column + axis..3 * column + 3);
                rows.extend(
                    self.column(column)
                        .iter()
                        .flat_map(|row| 3 * row..3 * row + 3),
                );
                columns.push(rows.len());
            }
        }
        (columns, rows)
    }
}
