"""Make the LIGGGHTS outputs in tests/data/liggghts: ``python tests/data/make_liggghts_data.py`` (needs LIGGGHTS)."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

from filtercake.crystals.csd import mixture
from filtercake.errors import EngineError
from filtercake.packing import contact_law
from filtercake.packing.cloud import make_cloud
from filtercake.packing.engines import liggghts
from filtercake.packing.engines.base import SettleRequest
from filtercake.packing.engines.liggghts_as_published import LiggghtsAsPublished
from filtercake.packing.scene import Scene
from filtercake.packing.settling import StopRule

DATA = Path(__file__).resolve().parent / "liggghts"


def request(folder: Path, checks: int, check_steps: int = 400) -> SettleRequest:
    """Sixty spheres of 30 and 50 um."""
    csd = mixture([30e-6, 50e-6], [0.5, 0.5])
    step = 0.36 * contact_law.rayleigh_time_step(15e-6, 1180.0, 5e6, 0.2)
    scene = Scene(csd, 60, 0.75, 0.01, 1180.0, 5e6, 0.2, 0.3, 0.0, 50e3, step, "liggghts")
    cloud = make_cloud(csd, scene.particles, scene.initial_void_fraction, 1)
    rule = dataclasses.replace(StopRule.for_bed(scene, cloud.length), max_checks=checks, check_steps=check_steps)
    return SettleRequest(scene, cloud, rule, 1, folder, print)


def short_run() -> None:
    """Keep the output and final dump of three checks."""
    with tempfile.TemporaryDirectory() as name:
        liggghts.Liggghts().settle(request(Path(name), checks=3))
        shutil.copy(Path(name) / "screen.log", DATA / "screen.log")
        shutil.copy(Path(name) / "final.dump", DATA / "final.dump")


def misspelt_command() -> None:
    """Keep the output of a deck with an unknown command."""
    with tempfile.TemporaryDirectory() as name, tempfile.TemporaryDirectory() as templates:
        shutil.copytree(liggghts.template_folder(), templates, dirs_exist_ok=True)
        deck = Path(templates) / "packing.in.j2"
        deck.write_text(deck.read_text(encoding="utf-8").replace("timestep  ", "timestepp "), encoding="utf-8")
        os.environ[liggghts.TEMPLATE_FOLDER_VARIABLE] = templates
        with contextlib.suppress(EngineError):
            liggghts.Liggghts().settle(request(Path(name), checks=3))
        del os.environ[liggghts.TEMPLATE_FOLDER_VARIABLE]
        shutil.copy(Path(name) / "screen.log", DATA / "error.log")


def terminated() -> None:
    """Keep the output of a run that was sent SIGTERM."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def stop() -> None:
            while b"@state 100000 " not in (folder / "screen.log").read_bytes():
                time.sleep(0.01)
            # only the program whose working directory is this run's own folder
            for pid in subprocess.run(["pgrep", "liggghts"], capture_output=True, text=True).stdout.split():
                with contextlib.suppress(OSError):
                    if Path(f"/proc/{pid}/cwd").resolve() == folder.resolve():
                        os.kill(int(pid), signal.SIGTERM)

        (folder / "screen.log").touch()
        thread = threading.Thread(target=stop)
        thread.start()
        with contextlib.suppress(EngineError):
            liggghts.Liggghts().settle(request(folder, checks=1000, check_steps=100_000))
        thread.join()
        shutil.copy(folder / "screen.log", DATA / "sigterm.log")


def as_published() -> None:
    """Keep the first kilobytes of the as-published protocol's output, up to what its insertion says."""
    with tempfile.TemporaryDirectory() as name:
        asked = request(Path(name), checks=1)
        asked = dataclasses.replace(asked, scene=dataclasses.replace(asked.scene, time_limit=2.0))
        with contextlib.suppress(EngineError):
            LiggghtsAsPublished().settle(asked)
        lines = (Path(name) / "screen.log").read_text(encoding="utf-8").splitlines(keepends=True)
        (DATA / "as_published_head.log").write_text("".join(lines[:110]), encoding="utf-8")


if __name__ == "__main__":
    DATA.mkdir(exist_ok=True)
    short_run()
    misspelt_command()
    terminated()
    as_published()
