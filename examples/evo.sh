#!/bin/sh
# Evaluates a run with evo (PyPI `evo`) beside Gyre's own evaluation: evo.sh OUT [GROUND_TRUTH.tum]
# evo takes the truth at the nearest stamp, Gyre interpolates it: they agree where the truth has the stamps of the scans.
set -eu
estimate="$1/trajectory.tum"
truth="${2:-$1/ground_truth.tum}"
evo_ape tum "$truth" "$estimate" --align
evo_rpe tum "$truth" "$estimate" --delta 1 --delta_unit f --pose_relation trans_part
evo_rpe tum "$truth" "$estimate" --delta 1 --delta_unit f --pose_relation angle_deg
gyre evaluate "$estimate" "$truth"
