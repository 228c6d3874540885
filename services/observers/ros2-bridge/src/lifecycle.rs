//! The states of a managed node, which publishes while it is active.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicU8, Ordering},
};

use gyre_client::clock;
use gyre_ros2_messages::lifecycle_msgs::{
    State, Transition, TransitionDescription, TransitionEvent,
};

use crate::outlet::Outlet;

const UNCONFIGURED: u8 = 1;
const INACTIVE: u8 = 2;
const ACTIVE: u8 = 3;
const FINALIZED: u8 = 4;

/// The names of the states, in the order of their numbers.
const STATES: [&str; 4] = ["unconfigured", "inactive", "active", "finalized"];

/// Each transition: number, name, and the states before and after it.
const TRANSITIONS: [(u8, &str, u8, u8); 7] = [
    (1, "configure", UNCONFIGURED, INACTIVE),
    (2, "cleanup", INACTIVE, UNCONFIGURED),
    (3, "activate", INACTIVE, ACTIVE),
    (4, "deactivate", ACTIVE, INACTIVE),
    (5, "shutdown", UNCONFIGURED, FINALIZED),
    (6, "shutdown", INACTIVE, FINALIZED),
    (7, "shutdown", ACTIVE, FINALIZED),
];

/// The state of a managed node.
pub struct Lifecycle {
    current: AtomicU8,
    /// Locked for the whole of a transition.
    events: Mutex<Outlet<TransitionEvent>>,
}

impl Lifecycle {
    pub fn new(events: Outlet<TransitionEvent>) -> Self {
        Self {
            current: AtomicU8::new(UNCONFIGURED),
            events: Mutex::new(events),
        }
    }

    fn current(&self) -> u8 {
        self.current.load(Ordering::Relaxed)
    }

    pub fn is_active(&self) -> bool {
        self.current() == ACTIVE
    }

    pub fn state(&self) -> State {
        state_of(self.current())
    }

    /// Makes a transition, and publishes it; false if the state does not have it.
    pub fn change(&self, wanted: &Transition) -> bool {
        let mut events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(made) = transition(self.current(), wanted) else {
            return false;
        };
        self.current.store(made.goal_state.id, Ordering::Relaxed);
        events.send(TransitionEvent {
            timestamp: clock::since_1970_ns().unsigned_abs(),
            transition: made.transition,
            start_state: made.start_state,
            goal_state: made.goal_state,
        });
        true
    }
}

/// Returns the transition of this name, else of this number, from a state.
fn transition(from: u8, wanted: &Transition) -> Option<TransitionDescription> {
    let mut from_here = transitions()
        .into_iter()
        .filter(|it| it.start_state.id == from);
    from_here.find(|it| match wanted.label.is_empty() {
        true => it.transition.id == wanted.id,
        false => it.transition.label == wanted.label,
    })
}

fn state_of(id: u8) -> State {
    State {
        id,
        label: STATES[usize::from(id - UNCONFIGURED)].to_owned(),
    }
}

pub fn states() -> Vec<State> {
    (UNCONFIGURED..=FINALIZED).map(state_of).collect()
}

pub fn transitions() -> Vec<TransitionDescription> {
    let described = |(id, label, from, to): (u8, &str, u8, u8)| TransitionDescription {
        transition: Transition {
            id,
            label: label.to_owned(),
        },
        start_state: state_of(from),
        goal_state: state_of(to),
    };
    TRANSITIONS.into_iter().map(described).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_has_its_transitions_by_number_or_by_name() {
        let to = |from, id, label: &str| {
            let label = label.to_owned();
            transition(from, &Transition { id, label }).map(|it| it.goal_state.id)
        };
        assert_eq!(to(UNCONFIGURED, 1, ""), Some(INACTIVE));
        assert_eq!(to(UNCONFIGURED, 3, ""), None);
        assert_eq!(to(INACTIVE, 0, "activate"), Some(ACTIVE));
        assert_eq!(to(ACTIVE, 0, "shutdown"), Some(FINALIZED));
        assert_eq!(to(FINALIZED, 1, ""), None);
    }
}
