//! Pipelines that are measured together begin together.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Lets pipelines that are measured together wait for each other after their warm-up.
#[derive(Debug)]
pub struct Gate {
    expected: usize,
    arrived: AtomicUsize,
}

impl Gate {
    /// A gate for so many pipelines.
    pub fn of(expected: usize) -> Self {
        Self {
            expected,
            arrived: AtomicUsize::new(0),
        }
    }

    /// The ticket of one pipeline.
    pub(super) fn ticket(&self) -> Ticket<'_> {
        Ticket {
            gate: self,
            has_arrived: false,
        }
    }

    /// Returns whether all pipelines have arrived.
    pub(super) fn is_open(&self) -> bool {
        self.arrived.load(Ordering::SeqCst) >= self.expected
    }
}

/// Arrives at the gate at its end at the latest: nobody waits for a pipeline that has failed.
pub(super) struct Ticket<'a> {
    gate: &'a Gate,
    has_arrived: bool,
}

impl Ticket<'_> {
    pub(super) fn arrive(&mut self) {
        if !std::mem::replace(&mut self.has_arrived, true) {
            self.gate.arrived.fetch_add(1, Ordering::SeqCst);
        }
    }
}

impl Drop for Ticket<'_> {
    fn drop(&mut self) {
        self.arrive();
    }
}
