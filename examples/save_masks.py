"""Save the motion mask of every slice as a PNG in the sensor's own pixels, for a labelling tool or another program.

python examples/save_masks.py RECORDING [FOLDER]
"""

import sys
from pathlib import Path

import cv2

import evimo

path = sys.argv[1]
folder = Path(sys.argv[2] if len(sys.argv) > 2 else "masks")
folder.mkdir(parents=True, exist_ok=True)

for estimate in evimo.run(path, model="small"):
    cv2.imwrite(str(folder / f"{estimate.t_us}.png"), estimate.ids)  # 0 is background, else the object's number
print(f"{len(list(folder.glob('*.png')))} masks in {folder}")
