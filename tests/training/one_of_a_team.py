"""One process of a team that trains on a pickled recording, for test_devices.py.

python one_of_a_team.py PICKLE OUT [STEP to be killed after]
"""

import os
import pickle
import signal
import sys
from pathlib import Path

import torch

from evimo.model.motion_net import MotionNet
from evimo.model.presets import PRESETS
from evimo.training import data
from evimo.training.config import TrainConfig
from evimo.training.data import samples_of
from evimo.training.devices import joined_team
from evimo.training.loop import Trainer
from evimo.training.sources import from_folders

CONFIG = TrainConfig(steps=3, batch=3, warm_up=2, save_every=1, bfloat16=False)


def report(step, terms):
    print(step, terms["loss"], flush=True)
    if str(step) in sys.argv[3:]:
        os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    data.CROP = (64, 64)
    torch.set_num_threads(1)
    torch.manual_seed(0)
    source = from_folders(samples_of([pickle.loads(Path(sys.argv[1]).read_bytes())]))
    with joined_team("cpu") as team:
        trainer = Trainer(MotionNet(PRESETS["tiny"]), CONFIG, source, Path(sys.argv[2]), team=team)
        trainer.resume()
        trainer.run(report)
