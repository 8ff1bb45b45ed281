"""What spawned processes import: a module of tests would bring PyTorch along, which takes them seconds."""

import os
import signal

from baselines.training import run


def dies_with_seed_7(one, train=run.train_seed):
    """Trains a seed, and is killed where the seed is 7."""
    if one.seed == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return train(one)
