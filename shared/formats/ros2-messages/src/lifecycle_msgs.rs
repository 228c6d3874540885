//! `lifecycle_msgs`: the states of a managed node, and the parts of its services.

use crate::definition::package;

package! { lifecycle_msgs:
    struct State {
        id: u8 = "uint8 id",
        label: String = "string label",
    }

    struct Transition {
        id: u8 = "uint8 id",
        label: String = "string label",
    }

    struct TransitionDescription {
        transition: Transition = "Transition transition",
        start_state: State = "State start_state",
        goal_state: State = "State goal_state",
    }

    /// The topic `~/transition_event`.
    struct TransitionEvent {
        timestamp: u64 = "uint64 timestamp",
        transition: Transition = "Transition transition",
        start_state: State = "State start_state",
        goal_state: State = "State goal_state",
    }
}
