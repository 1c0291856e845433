"""Print the camera's motion and what moves by itself, slice by slice.

python examples/print_moving_objects.py RECORDING [CALIBRATION]
"""

import sys

import evimo

path = sys.argv[1]
calibration = sys.argv[2] if len(sys.argv) > 2 else None

for estimate in evimo.run(path, camera=calibration):
    print(estimate.t_us, estimate.ego, [(thing.id, thing.centroid) for thing in estimate.objects])
