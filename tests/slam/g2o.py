"""Prints the numbers of edges and of poses of a graph, and its last pose, as GTSAM reads them.

usage: g2o.py GRAPH
"""

import gtsam, sys
graph, poses = gtsam.readG2o(sys.argv[1], False)
last = poses.atPose2(poses.size() - 1)
print(graph.size(), poses.size(), last.x(), last.y(), last.theta())
