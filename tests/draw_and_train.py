"""A program: draws and trains in the order it is told, around one command of the command line.

``draw_and_train.py draw,train,verb,draw,train -- simulate --out DIR``. Where a verb would wait for
a person or a browser, ``interrupt:SECONDS`` in the place of ``verb`` runs it until Ctrl+C.
"""

import signal
import sys
import threading


def draw() -> None:
    """One frame of a camera."""
    import numpy as np

    from steerlab.sim.engine.camera import Camera
    from steerlab.sim.engine.driving import Driving
    from steerlab.sim.world_generator import generate_world

    world = generate_world("any", np.random.default_rng(0))
    with Driving(world) as driving, Camera(driving.model, driving.data) as camera:
        assert camera.frame().std() > 0.0


def train() -> None:
    """One step of an optimiser; with Triton installed, PyTorch imports it for that."""
    import torch

    weight = torch.nn.Parameter(torch.ones(3))
    optimiser = torch.optim.Adam([weight])
    weight.square().sum().backward()
    optimiser.step()


def run(steps: list[str], command: list[str]) -> int:
    """Each step in turn, until one fails; 1 if the verb found something wrong."""
    from steerlab.app.cli import main

    worst = 0
    for step in steps:
        if step in ("draw", "train"):
            {"draw": draw, "train": train}[step]()
            continue
        if step.startswith("interrupt:"):
            wait_s = float(step.partition(":")[2])
            threading.Timer(wait_s, signal.raise_signal, [signal.SIGINT]).start()
        code = main(command)
        if code not in (0, 1, 128 + signal.SIGINT):  # 1: done, and it found something wrong
            return code
        worst = max(worst, int(code == 1))
    return worst


if __name__ == "__main__":
    # Whoever is started in the background of a script is told to ignore Ctrl+C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    split = sys.argv.index("--")
    sys.exit(run(sys.argv[1].split(","), sys.argv[split + 1 :]))
