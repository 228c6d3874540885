"""Prints the numbers of edges and of poses of a graph, and its last pose, as GTSAM reads them; and by how much its poses are from
GTSAM's optimum at most, m.

usage: g2o.py GRAPH
"""

import gtsam, sys
import numpy as np

graph, poses = gtsam.readG2o(sys.argv[1], False)
last = poses.atPose2(poses.size() - 1)
edges = graph.size()
graph = gtsam.NonlinearFactorGraph(graph)
graph.add(gtsam.PriorFactorPose2(0, poses.atPose2(0), gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-6))))
parameters = gtsam.LevenbergMarquardtParams()
parameters.setRelativeErrorTol(1e-12)
solved = gtsam.LevenbergMarquardtOptimizer(graph, poses, parameters).optimize()
apart_m = max(np.linalg.norm(solved.atPose2(k).translation() - poses.atPose2(k).translation()) for k in range(poses.size()))
print(edges, poses.size(), last.x(), last.y(), last.theta(), apart_m)
