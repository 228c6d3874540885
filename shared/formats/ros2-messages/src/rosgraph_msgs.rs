//! `rosgraph_msgs`: the time of a replay.

use crate::{builtin_interfaces::Time, definition::package};

package! { rosgraph_msgs:
    /// The topic `/clock`: the time of nodes with `use_sim_time`.
    struct Clock {
        clock: Time = "builtin_interfaces/Time clock",
    }
}
