"""The permeability of packings by the API and on the command line: closed forms, one answer in all ways, errors."""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filtercake import api
from filtercake.cli.commands import main
from filtercake.errors import ConfigError, PackingRejected
from filtercake.packing.result import Packing
from filtercake.statistics import half_width

UM = 1e-6
BED = ["--mixture", "30:0.5,50:0.5", "--density-kg-m3", "1180", "--particles", "200", "--engine", "embedded"]
COARSE = ["--accuracy", "0.1"]
SPENT = ("wall_s", "memory_MB")
"""What a repetition may change."""

Capture = pytest.CaptureFixture[str]


def simple_cubic(solids: float, side: float = 40 * UM) -> dict[str, Any]:
    radius = (0.75 * solids / math.pi) ** (1 / 3) * side
    return {"position": np.full((1, 3), 0.5 * side), "radius": np.array([radius]), "box": np.full(3, side)}


def save(path: Path, arrays: dict[str, Any]) -> str:
    np.savez(path, **arrays)
    return str(path)


def run(arguments: list[str], capsys: Capture) -> tuple[str, str]:
    capsys.readouterr()
    assert main(["permeability", *arguments]) == 0
    printed = capsys.readouterr()
    return printed.out, printed.err


def as_json(arguments: list[str], capsys: Capture) -> dict[str, Any]:
    found = json.loads(run([*arguments, "--json"], capsys)[0])
    assert isinstance(found, dict)
    return found


def complaint(arguments: list[str], capsys: Capture) -> str:
    capsys.readouterr()
    assert main(["permeability", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.startswith("filtercake: ") and printed.err.count("\n") == 1
    return printed.err


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two tiny packings."""
    folder = tmp_path_factory.mktemp("packed") / "bed"
    assert main(["pack", *BED, "--replicates", "2", "--output", str(folder)]) == 0
    return folder


@pytest.mark.parametrize(("solids", "published"), [(0.5236, 42.1), (0.343, 15.4)])
def test_simple_cubic_arrays(solids: float, published: float, tmp_path: Path, capsys: Capture) -> None:
    # Zick and Homsy, J. Fluid Mech. 115 (1982) 13: K = d^2 / (18 phi k)
    arrays = simple_cubic(solids)
    found = as_json([save(tmp_path / "cubic.npz", arrays), "--accuracy", "0.005"], capsys)["packings"][0]
    diameter = 2.0 * float(arrays["radius"][0])
    assert diameter**2 / (18.0 * solids * found["permeability_m2"]) == pytest.approx(published, rel=0.01)
    assert found["porosity"] == pytest.approx(1.0 - solids, abs=0.01)
    assert found["sauter_mean_um"] == pytest.approx(diameter / UM)
    assert found["resistance_m_kg"] is None and found["density_kg_m3"] is None


def test_the_numbers_follow_from_one_another(packed: Path) -> None:
    found = api.permeability(packed / "r0.npz", accuracy=0.05, sphericity=0.8)
    eps, k, sauter = found.porosity, found.permeability_m2, found.sauter_mean_um * UM
    assert found.density_kg_m3 == 1180.0  # of the record
    assert found.resistance_m_kg == pytest.approx(1.0 / (k * 1180.0 * (1.0 - eps) * 0.8**2))
    assert found.kozeny_constant == pytest.approx(eps**3 * sauter**2 / (k * (1.0 - eps) ** 2))
    numerical = math.hypot(found.resolution_relative_ci95, found.convergence_relative_ci95)
    assert found.permeability_ci95_m2 == pytest.approx(k * numerical)
    assert found.resistance_ci95_m_kg == pytest.approx(found.resistance_m_kg * numerical)
    whole = math.hypot(numerical, found.slab_relative_ci95)
    assert found.kozeny_constant_ci95 == pytest.approx(found.kozeny_constant * whole)
    assert found.levels[-1].permeability_m2 == k
    assert found.particles == 200 and found.memory_MB > 1.0 and found.wall_s > 0.0
    # a tiny bed of spheres that touch: Carman's constant, with an interval for so few
    assert abs(found.kozeny_constant - 170.0) < 2.0 * found.kozeny_constant_ci95
    assert eps == pytest.approx(api.porosity(packed / "r0.npz").porosity, abs=0.03)


def test_file_packing_arrays_and_a_file_without_a_record_give_the_same(packed: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare.npz"
    shutil.copy(packed / "r0.npz", bare)
    bare.with_suffix(".json").write_text('{"program": "of my own"}', encoding="utf-8")
    packing = Packing.load(packed / "r0.npz")
    assert packing.is_cell
    arrays = {"position": packing.position, "radius": packing.radius, "box": np.full(3, packing.length)}
    found = [
        api.permeability(source, accuracy=0.1, density_kg_m3=1180)
        for source in (packed / "r0.npz", str(bare), packing, arrays)
    ]
    plain = [{key: value for key, value in asdict(item).items() if key not in SPENT} for item in found]
    assert plain == [plain[0]] * 4
    assert api.permeability(packing, accuracy=0.1).density_kg_m3 == 1180.0
    assert api.permeability(bare, accuracy=0.1).resistance_m_kg is None


def test_text_and_json_say_what_the_api_says(packed: Path, capsys: Capture) -> None:
    files = [str(packed / f"r{k}.npz") for k in (0, 1)]
    found = as_json([*files, *COARSE], capsys)
    lines: list[str] = []
    called = api.permeabilities(files, accuracy=0.1, say=lines.append)
    for row, item in zip(found["packings"], called, strict=True):
        assert {**row, **dict.fromkeys(SPENT)} == {
            **json.loads(json.dumps(asdict(item))),
            **dict.fromkeys(SPENT),
            "file": row["file"],
        }
    constants = [item.kozeny_constant for item in called]
    assert found["kozeny_constant"] == pytest.approx(np.mean(constants))
    assert found["kozeny_constant_between_packings_ci95"] == pytest.approx(half_width(np.array(constants)))
    assert found["kozeny_constant_ci95"] < min(item.kozeny_constant_ci95 for item in called)
    text, progress = run([*files, *COARSE], capsys)
    assert progress.count("\n") == len(lines) == sum(len(item.levels) for item in called)
    assert all(line.startswith((files[0], files[1])) for line in lines)
    first = text.split(files[1])[0]
    for key, name in (
        ("permeability_m2", "permeability"),
        ("resistance_m_kg", "resistance"),
        ("kozeny_constant", "Kozeny constant"),
    ):
        (line,) = re.findall(rf"^{name} +(\S+) \+- (\S+)", first, re.MULTILINE)
        half = key.replace("_m2", "_ci95_m2").replace("_m_kg", "_ci95_m_kg")
        half = half if half != key else f"{key}_ci95"
        row = found["packings"][0]
        assert line == (f"{row[key]:.4g}", f"{row[half]:.4g}")
    shown = f"{found['kozeny_constant']:.4g} +- {found['kozeny_constant_ci95']:.4g} (95 %)"
    alone = f"from the spread of these 2 alone +- {found['kozeny_constant_between_packings_ci95']:.4g}"
    assert text.splitlines()[-1] == f"mean Kozeny constant: {shown}; {alone}"


def test_one_packing_has_no_interval_between_packings(tmp_path: Path, capsys: Capture) -> None:
    file = save(tmp_path / "cubic.npz", simple_cubic(0.343))
    found = as_json([file, *COARSE], capsys)
    assert found["kozeny_constant"] == found["packings"][0]["kozeny_constant"]
    assert found["kozeny_constant_ci95"] == pytest.approx(found["packings"][0]["kozeny_constant_ci95"])
    assert found["kozeny_constant_between_packings_ci95"] is None
    text, _ = run([file, *COARSE], capsys)
    assert "needs --density-kg-m3" in text and "mean Kozeny" not in text and "nan" not in text


def test_scale_and_a_cell_of_several_cells_change_nothing() -> None:
    one = simple_cubic(0.343)
    large = {key: 10.0 * value for key, value in one.items()}
    grid = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    several = {
        "position": one["position"] + grid * one["box"],
        "radius": np.repeat(one["radius"], 8),
        "box": 2.0 * one["box"],
    }
    found = [api.permeability(arrays, accuracy=0.01) for arrays in (one, large, several)]
    assert found[1].permeability_m2 == pytest.approx(100.0 * found[0].permeability_m2, rel=1e-3)
    assert found[2].permeability_m2 == pytest.approx(found[0].permeability_m2, rel=0.01)


def test_mistakes_are_one_line_and_nothing_is_solved_before(packed: Path, tmp_path: Path, capsys: Capture) -> None:
    good, wrong = str(packed / "r0.npz"), save(tmp_path / "wrong.npz", {"position": np.zeros((1, 3))})
    said = complaint([good, wrong], capsys)
    assert f"{wrong}: radius = (missing): must be given, shape (n,), in m; there is position" in said
    assert "nodes" not in said
    millimetres = {key: 1e3 * value for key, value in simple_cubic(0.343).items()}
    file = save(tmp_path / "mm.npz", millimetres)
    assert "no filter is for crystals so coarse" in complaint([file], capsys)
    assert main(["permeability", file, "--trust-units", *COARSE]) == 0
    cubic = save(tmp_path / "cubic.npz", simple_cubic(0.343))
    assert "--density-kg-m3 = 2.5: lighter than any solid" in complaint([cubic, "--density-kg-m3", "2.5"], capsys)
    assert "--sphericity = 2.0: must be" in complaint([cubic, "--sphericity", "2"], capsys)


def test_a_damaged_packing_is_not_taken_for_somebody_elses(packed: Path, tmp_path: Path) -> None:
    for name in ("r0.npz", "r0.json"):
        shutil.copy(packed / name, tmp_path / name)
    packing = Packing.load(packed / "r0.npz")
    np.savez(tmp_path / "r0.npz", position=packing.position, radius=packing.radius, length=1.1 * packing.length)
    with pytest.raises(PackingRejected, match="checksum"):
        api.permeability(tmp_path / "r0.npz")
    (tmp_path / "r0.json").write_text('{"seal": ', encoding="utf-8")
    with pytest.raises(PackingRejected, match=re.escape("r0.json cannot be read")):
        api.permeability(tmp_path / "r0.npz")


def test_what_the_solver_refuses_names_the_packing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("filtercake.permeability.measure.available_bytes", lambda: 1e5)
    with pytest.raises(PackingRejected, match=r"arrays: the flow on .* takes .* GB of memory"):
        api.permeability(simple_cubic(0.343))
    with pytest.raises(ConfigError, match="accuracy"):
        api.permeability(simple_cubic(0.343), accuracy="fine")
    with pytest.raises(ConfigError, match="did you mean threads"):
        api.permeability(simple_cubic(0.343), thread=2)
