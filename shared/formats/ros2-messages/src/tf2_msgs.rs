//! `tf2_msgs`: the tree of frames.

use crate::{definition::package, geometry_msgs::TransformStamped};

package! { tf2_msgs:
    /// Poses of frames in other ones: the topics `/tf` and `/tf_static`.
    struct TFMessage {
        transforms: Vec<TransformStamped> = "geometry_msgs/TransformStamped[] transforms",
    }
}
