//! Cells as planners know them.

use crate::Cell;

/// A cell is known if it was looked at half a time from nearby, and occupied if it returned a
/// sixteenth of the power it might have.
const KNOWN_LOOKED: u8 = 16;
const OCCUPIED_EVIDENCE: u8 = 64;

/// The meaning of a cell to a planner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Occupancy {
    /// It was hardly looked at.
    Unknown,
    /// It returned little of the power that it might have.
    Free,
    Occupied,
}

impl Occupancy {
    pub fn of(cell: Cell) -> Self {
        match cell {
            cell if cell.looked < KNOWN_LOOKED => Self::Unknown,
            cell if cell.evidence >= OCCUPIED_EVIDENCE => Self::Occupied,
            _ => Self::Free,
        }
    }
}
