"""Print the camera's motion and what moves by itself, slice by slice.

python examples/print_moving_objects.py RECORDING
"""

import sys

import evimo

path = sys.argv[1]

for estimate in evimo.run(path, model="small"):
    print(estimate.t_us, estimate.ego, [(thing.id, thing.centroid) for thing in estimate.objects])
