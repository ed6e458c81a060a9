"""One of two MPI ranks that is asked to stop waits for the other for ever: the runner must end them both."""

import contextlib
import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

from filtercake.crystals.csd import mixture
from filtercake.errors import EngineError
from filtercake.packing.engines.liggghts import LOOK_SECONDS, find_executable
from filtercake.packing.pack import pack
from filtercake.packing.scene import Scene

SCENE = Scene(
    csd=mixture([30e-6, 50e-6], [0.5, 0.5]),
    particles=2000,
    initial_void_fraction=0.65,
    settling_velocity=0.01,
    density=1180.0,
    youngs_modulus=5e6,
    poisson_ratio=0.2,
    restitution=0.3,
    friction=0.0,
    cohesion=0.0,
    time_step=0.02e-6,
    engine="liggghts",
    processes=2,
    time_limit=120.0,
)


def ranks(folder):
    """Process numbers of the LIGGGHTS ranks that work in a folder."""
    found = subprocess.run(["pgrep", "-x", "liggghts"], capture_output=True, text=True, check=False).stdout.split()
    here = []
    for pid in found:
        with contextlib.suppress(FileNotFoundError):  # it may end while we look
            if Path(f"/proc/{pid}/cwd").readlink() == folder.resolve():
                here.append(int(pid))
    return here


@pytest.mark.slow
@pytest.mark.liggghts
def test_a_rank_asked_to_stop_ends_the_packing(tmp_path):
    if find_executable() is None or shutil.which("mpirun") is None or shutil.which("pgrep") is None:
        pytest.skip("needs LIGGGHTS, mpirun and pgrep")

    def stop_one():
        for _ in range(200):
            if len(ranks(tmp_path)) == 2:
                time.sleep(1.0)
                os.kill(ranks(tmp_path)[0], signal.SIGTERM)
                return
            time.sleep(0.1)

    thread = threading.Thread(target=stop_one)
    thread.start()
    started = time.monotonic()
    with pytest.raises(EngineError, match="asked to stop") as refusal:
        pack(SCENE, mixture([20e-6, 50e-6], [0.5, 0.5]), 0, tmp_path)
    thread.join()
    assert refusal.value.transient
    assert time.monotonic() - started < 30.0 + 4.0 * LOOK_SECONDS
    assert not ranks(tmp_path)
