"""LIGGGHTS as a packing engine: the tuned deck, its files, and its own words when something is wrong."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np

from filtercake.errors import EngineError, EngineMissing
from filtercake.packing.cloud import Cloud
from filtercake.packing.engines import micro, process
from filtercake.packing.engines.base import Engine, SettleRequest, parallelism
from filtercake.packing.engines.liggghts_log import UNKNOWN_VERSION, LiggghtsLog, parse_log, trajectory
from filtercake.packing.engines.micro import UnitSystem
from filtercake.packing.result import SettledState
from filtercake.packing.scene import Scene
from filtercake.packing.settling import WINDOW, Trajectory
from filtercake.units import GRAVITY, FloatArray
from filtercake.user_files import templates

EXECUTABLE_VARIABLE = "FILTERCAKE_LIGGGHTS"
EXECUTABLES = ("liggghts", "lmp_auto", "lmp_liggghts")
TEMPLATE_FOLDER_VARIABLE = "FILTERCAKE_TEMPLATES"
PROGRESS_SECONDS = 20.0
LOOK_SECONDS = 5.0

_BLOWN_UP = ("Lost atoms", "Non-numeric", "out of range", "Out of range", "neighbor list", "Bond atoms missing")
"""Words of LIGGGHTS's errors about spheres that fly apart, not about its input."""
SAME = 1e-9
"""Relative difference that a dump may have from what LIGGGHTS printed; they agree to 1e-14."""
_COLUMNS = ("id", "type", "x", "y", "z", "vx", "vy", "vz", "radius")


def template_folder() -> Path:
    """Folder of the deck templates: the one an environment variable names, or the package's own.

    In a checkout the package's is a link to ``liggghts_templates``; an installed package has a copy.
    """
    named = os.environ.get(TEMPLATE_FOLDER_VARIABLE)
    return Path(named) if named else Path(__file__).with_name("decks")


def find_executable() -> str | None:
    """Path of the LIGGGHTS executable, None where there is none."""
    named = os.environ.get(EXECUTABLE_VARIABLE)
    if named:
        return shutil.which(named)
    return next((path for path in map(shutil.which, EXECUTABLES) if path), None)


class Liggghts(Engine):
    """LIGGGHTS with the tuned deck: shared cloud, tight box, small skin, only what the scene needs, early stop."""

    name = "liggghts"
    label = "LIGGGHTS"
    template = "packing.in.j2"
    sphere_step = (105e-9, 118e-9)
    wide_factor = 1.8  # a wide distribution fills its one neighbour grid with pairs that never touch
    least_restitution = 0.05
    evidence = ("packing.in", "cloud.data", "screen.log")
    by_hand = "liggghts -echo screen -in packing.in"

    def __init__(self, *, force_tangential: bool = False, units: UnitSystem = micro.MICRO):
        """Create the engine.

        Parameters
        ----------
        force_tangential : bool
            Keep the tangential part at mu = 0 (to prove that it does nothing).
        units : UnitSystem
            Units of the deck.
        """
        self.force_tangential = force_tangential
        self.units = units

    def why_missing(self) -> str | None:
        """Say why LIGGGHTS cannot run here, None where it can."""
        if find_executable() is not None:
            return None
        named = os.environ.get(EXECUTABLE_VARIABLE)
        if named:
            return f"LIGGGHTS is not at {named} (named by {EXECUTABLE_VARIABLE})"
        return (
            "LIGGGHTS is not installed (no `liggghts` on the PATH): on Debian, `sudo apt-get install liggghts`, "
            f"or set {EXECUTABLE_VARIABLE} to the executable"
        )

    def write_input(self, request: SettleRequest) -> None:
        """Write the deck and, where it reads one, the cloud."""
        if not self.own_spheres:
            write_cloud(request.cloud, request.scene.density, request.folder / "cloud.data", self.units)
        deck = render(self.template, self._deck_values(request))
        (request.folder / "packing.in").write_text(deck, encoding="utf-8")

    def _deck_values(self, request: SettleRequest) -> dict[str, Any]:
        scene, rule = request.scene, request.rule
        return {
            **material_values(scene, self.units),
            "contact_model": contact_model(scene.friction > 0.0 or self.force_tangential, scene.cohesion > 0.0),
            "tangential": scene.friction > 0.0 or self.force_tangential,
            "cloud_file": "cloud.data",
            "length": micro.number(request.cloud.length / self.units.length),
            "skin": micro.number((scene.skin or default_skin(request.cloud)) / self.units.length),
            "check_steps": rule.check_steps,
            "max_checks": rule.max_checks,
            "calm_checks": rule.calm_checks,
            "window": WINDOW,
            "height_tolerance": micro.number(rule.height_tolerance),
            "energy_fraction": micro.number(rule.energy_fraction),
            "write_vtk": scene.write_vtk,
        }

    def settle(self, request: SettleRequest) -> SettledState:
        """Run LIGGGHTS and read the outcome (see :class:`filtercake.packing.engines.base.Engine`)."""
        folder, scene = request.folder, request.scene
        self.write_input(request)
        screen = folder / "screen.log"
        started = time.monotonic()
        status = process.run(command(parallelism(scene)), folder, screen, scene.time_limit, _Watcher(screen, request))
        wall_time = time.monotonic() - started
        log = parse_log(screen.read_text(encoding="utf-8", errors="replace"))
        check_end(status, log)
        position, velocity, radius = read_dump(folder / "final.dump", self.units)
        length = request.cloud.length
        seen = trajectory(log, scene.time_step, length, scene.density, self.units)
        wanted = (log.inserted or 0) if self.own_spheres else request.cloud.radius.size
        if radius.size == wanted:  # one that lacks spheres is told so by the acceptance checks
            check_dump(position, velocity, 4.0 / 3.0 * np.pi * scene.density * radius**3, seen)
        position[:, :2] %= length
        return SettledState(
            position=position,
            velocity=velocity,
            radius=radius,
            length=length,
            trajectory=seen,
            steps=log.finished_step or 0,
            expected=wanted,
            dangerous_builds=log.dangerous_builds,
            engine=self.name,
            engine_version=log.version,
            warnings=log.warnings,
            wall_time=wall_time,
        )


class _Watcher:
    """Reads the growing screen output and reports how far a long packing is."""

    def __init__(self, screen: Path, request: SettleRequest):
        self.screen, self.request = screen, request
        self.looked = self.reported = time.monotonic()

    def __call__(self) -> None:
        now = time.monotonic()
        if now - self.looked < LOOK_SECONDS:
            return
        self.looked = now
        tail = self._tail()
        if tail.forced_end:
            # one of several ranks that is asked to stop waits for the others for ever
            raise EngineError("LIGGGHTS was asked to stop by a signal and did not end", transient=True)
        if now - self.reported >= PROGRESS_SECONDS and tail.states.size:
            self.reported = now
            step, height = int(tail.states[-1, 0]), tail.states[-1, 1]
            self.request.progress(f"step {step:,}, mean height of the spheres {height:.1f} um")

    def _tail(self) -> LiggghtsLog:
        with self.screen.open("rb") as stream:
            stream.seek(0, os.SEEK_END)
            stream.seek(max(0, stream.tell() - 8192))
            return parse_log(stream.read().decode("utf-8", "replace"))


def render(template: str, values: dict[str, Any]) -> str:
    """Fill a deck template.

    Raises
    ------
    EngineError
        If the template is missing or asks for a value that is not given.
    """
    import jinja2

    folder = template_folder()
    try:
        return templates(folder).get_template(template).render(values)
    except jinja2.TemplateNotFound:
        raise EngineError(f"deck template {folder / template} does not exist") from None
    except jinja2.TemplateError as error:
        raise EngineError(f"deck template {folder / template}: {error}") from None


def contact_model(tangential: bool, cohesive: bool) -> str:
    """LIGGGHTS's words for the contact law; mu = 0 makes the tangential part exactly nothing, so it is left out."""
    return "model hertz" + (" tangential history" if tangential else "") + (" cohesion sjkr" if cohesive else "")


def default_skin(cloud: Cloud) -> float:
    """Neighbour skin, m: 15 % of the smallest diameter keeps the pair list near the real contacts."""
    return 0.3 * float(cloud.radius.min())


def command(process_count: int) -> list[str]:
    """Command line; output unbuffered and echoed, or an input error's message is lost in MPI_Abort."""
    executable = find_executable()
    if executable is None:
        raise EngineMissing(Liggghts().why_missing() or "LIGGGHTS is missing")
    launcher: list[str] = []
    if process_count > 1:
        launcher = ["mpirun", "-np", str(process_count), "--oversubscribe", "--bind-to", "none"]
        if os.geteuid() == 0:
            launcher.append("--allow-run-as-root")
    return [*launcher, "stdbuf", "-o0", executable, "-echo", "screen", "-log", "none", "-in", "packing.in"]


def write_cloud(cloud: Cloud, density: float, path: Path, units: UnitSystem = micro.MICRO) -> None:
    """Write a cloud as a LIGGGHTS data file, in a box twice as high.

    Small spheres are thrown up when large ones land; what leaves the box is lost.
    """
    margin = float(cloud.radius.max())
    lo, hi = micro.number(-margin / units.length), micro.number((2.0 * cloud.height + margin) / units.length)
    side = micro.number(cloud.length / units.length)
    header = (
        f"initial cloud, units {units.name}\n\n{cloud.radius.size} atoms\n1 atom types\n\n"
        f"0 {side} xlo xhi\n0 {side} ylo yhi\n{lo} {hi} zlo zhi\n\nAtoms\n\n"
    )
    n = cloud.radius.size
    rows = np.column_stack(
        [
            np.arange(1, n + 1),
            np.ones(n),
            2.0 * cloud.radius / units.length,
            np.full(n, density / units.density),
            cloud.position / units.length,
        ]
    )
    with path.open("w", encoding="ascii") as stream:
        stream.write(header)
        np.savetxt(stream, rows, fmt=["%d", "%d", "%.17g", "%.17g", "%.17g", "%.17g", "%.17g"])


def read_dump(path: Path, units: UnitSystem = micro.MICRO) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read the final dump: positions (n, 3) m, velocities (n, 3) m/s, radii (n,) m, sorted by atom number.

    Raises
    ------
    EngineError
        If the dump is missing, empty, cut short, or not the table the deck asks for (transient: try again).
    """
    try:
        text = path.read_text(encoding="ascii", errors="replace")
    except OSError as error:
        raise EngineError(f"the final dump cannot be read: {error.strerror}", transient=True) from None
    lines = text.splitlines()
    start = next((k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS")), None)
    if start is None or len(lines) < 5 or tuple(lines[start].split()[2:]) != _COLUMNS:
        raise EngineError("the final dump is empty or cut short (no atom table)", transient=True)
    try:
        promised = int(lines[lines.index("ITEM: NUMBER OF ATOMS") + 1])
        table = np.array([line.split() for line in lines[start + 1 :]], dtype=np.float64)
    except ValueError:
        raise EngineError("the final dump is cut short or garbled in a row", transient=True) from None
    if table.shape != (promised, len(_COLUMNS)) or not text.endswith("\n"):
        raise EngineError(f"the final dump promises {promised} atoms but holds {len(table)}", transient=True)
    if np.unique(table[:, 0]).size != promised:
        raise EngineError("the final dump holds an atom twice", transient=True)
    table = table[np.argsort(table[:, 0])]
    return table[:, 2:5] * units.length, table[:, 5:8] * units.velocity, table[:, 8] * units.length


def check_dump(position: FloatArray, velocity: FloatArray, mass: FloatArray, seen: Trajectory) -> None:
    """Hold the final dump against what LIGGGHTS printed last: mean height and kinetic energy of all spheres.

    Parameters
    ----------
    position, velocity : ndarray, shape (n, 3)
        As dumped, m and m/s.
    mass : ndarray, shape (n,)
        Masses of the spheres, kg.
    seen : Trajectory
        What was printed, of the same step as the dump at its end.

    Raises
    ------
    EngineError
        If they differ, so that the file was damaged on its way (transient: try again). Values that are not finite are
        left to the acceptance checks: the bed may have exploded.
    """
    height = float(mass @ position[:, 2] / mass.sum())
    energy = float(0.5 * mass @ (velocity**2).sum(axis=1))
    told = (float(seen.mean_height[-1]), float(seen.kinetic_energy[-1]))
    if np.isfinite((height, energy, *told)).all() and not np.allclose((height, energy), told, rtol=SAME, atol=0.0):
        raise EngineError(
            f"the final dump is damaged: mean height {height:.9g} m and kinetic energy {energy:.9g} J of its spheres, "
            f"where LIGGGHTS printed {told[0]:.9g} m and {told[1]:.9g} J",
            transient=True,
        )


def check_end(status: int, log: LiggghtsLog) -> None:
    """Raise unless LIGGGHTS ended well: exit status 0, end marker, and no forced end.

    LIGGGHTS answers SIGTERM and a full disk with exit status 0; an input error only shows in its output.

    Raises
    ------
    EngineError
        In LIGGGHTS's own words where it has any.
    """
    if log.error is not None:
        blown = any(word in log.error for word in _BLOWN_UP)
        # of a program that is not LIGGGHTS another installation may make the packing; an error in the input stays one
        another = log.version == UNKNOWN_VERSION
        raise EngineError(f"LIGGGHTS: {log.error}", may_pass=another, outcome="exploded" if blown else "refused")
    if status < 0:
        # a bed that flies apart may end in a crash as well
        raise EngineError(f"LIGGGHTS was killed by signal {-status}", transient=True, outcome="exploded")
    if log.forced_end:
        raise EngineError("LIGGGHTS was asked to stop by a signal before the bed was at rest", transient=True)
    if status != 0:
        raise EngineError(f"LIGGGHTS ended with status {status}; its last line: {log.last_line!r}", transient=True)
    if log.finished_step is None:
        raise EngineError(
            f"LIGGGHTS ended before its deck did (stopped, or disk full); its last line: {log.last_line!r}",
            transient=True,
        )


def material_values(scene: Scene, units: UnitSystem) -> dict[str, Any]:
    """Return what every deck says of material and protocol, in its units."""
    return {
        "units": units.name,
        "engine_seed": scene.seed,
        "youngs_modulus": micro.number(scene.youngs_modulus / units.pressure),
        "poisson_ratio": micro.number(scene.poisson_ratio),
        "restitution": micro.number(scene.restitution),
        "friction": micro.number(scene.friction),
        "cohesion": micro.number(scene.cohesion / units.pressure),
        "cohesive": scene.cohesion > 0.0,
        "density": micro.number(scene.density / units.density),
        "gravity": micro.number(GRAVITY / units.acceleration),
        "time_step": micro.number(scene.time_step / units.time),
        "settling_velocity": micro.number(scene.settling_velocity / units.velocity),
    }
