//! `tf2_msgs`: the tree of frames.

use serde::{Deserialize, Serialize};

use crate::{definition::message, geometry_msgs::TransformStamped};

/// Poses of frames in other ones: the topics `/tf` and `/tf_static`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    pub transforms: Vec<TransformStamped>,
}
message!(
    TFMessage,
    "tf2_msgs",
    "geometry_msgs/TransformStamped[] transforms\n",
    [TransformStamped]
);
