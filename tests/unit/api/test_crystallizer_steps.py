"""Crystallizers by their options: mixed, with fines dissolution and classified removal, and cascades."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from filtercake import api
from filtercake.crystals.crystallizer import PRESETS
from filtercake.errors import ConfigError, CrystallizerError

ALUM: dict[str, Any] = {"kinetics": "ammonium_alum", "residence_time_min": 15, "slurry_concentration_kg_m3": 200}


def test_alone_it_is_the_distribution_of_the_kinetics() -> None:
    found, plain = api.crystallizer(**ALUM), api.distribution(**ALUM)
    assert found.csd.sauter_mean == pytest.approx(plain.full.sauter_mean, rel=1e-12)
    assert found.csd.sum_x_over_d2 == pytest.approx(plain.full.sum_x_over_d2, rel=1e-12)
    assert found.growth_rate_m_s == (pytest.approx(6.4907e-8, rel=1e-4),)
    assert found.density_kg_m3 == plain.density_kg_m3 == 2450.0
    assert found.warnings == ()


def test_fines_dissolution_and_classified_removal() -> None:
    fines = api.crystallizer(fines_ratio=5, fines_size_um=50, **ALUM)
    both = api.crystallizer(fines_ratio=5, fines_size_um=50, classification_ratio=3, classification_size_um=300, **ALUM)
    plain = api.crystallizer(**ALUM)
    assert fines.csd.sauter_mean > both.csd.sauter_mean > plain.csd.sauter_mean
    assert both.product_concentration_kg_m3 > 200.0 == pytest.approx(fines.product_concentration_kg_m3)


@pytest.mark.parametrize("given", ["list", "text"])
def test_a_cascade_from_a_list_or_text(given: str) -> None:
    values: tuple[Any, Any] = ([5, 5, 5], [66, 133, 200]) if given == "list" else ("5, 5,5", "66,133,200")
    found = api.crystallizer(
        kinetics="ammonium_alum", residence_time_min=values[0], slurry_concentration_kg_m3=values[1]
    )
    assert len(found.growth_rate_m_s) == len(found.nucleation_rate_m3_s) == 3
    assert found.csd.sauter_mean == pytest.approx(150.2e-6, rel=1e-3)
    assert found.product_concentration_kg_m3 == 200.0
    assert found.warnings == ("residence_time_min = 5: the kinetics ammonium_alum are meant for 15 to 60 min",)


def test_kinetics_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(PRESETS.read_text(encoding="utf-8").replace("ammonium_alum", "mine"), encoding="utf-8")
    found = api.crystallizer(**{**ALUM, "kinetics": "mine"}, kinetics_file=str(path))
    assert found.csd.sauter_mean == pytest.approx(api.crystallizer(**ALUM).csd.sauter_mean)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"fines_ratio": 5}, "fines_ratio above 1 and fines_size_um go together"),
        ({"classification_size_um": 300}, "classification_ratio above 1 and classification_size_um go together"),
        ({"residence_time_min": "5,x"}, r"residence_time_min\[1\] = 'x': must be a number"),
        ({"residence_time_min": []}, "residence_time_min = .*must hold at least one value"),
        (
            {"residence_time_min": [5, 5], "fines_ratio": 5, "fines_size_um": 50},
            "a cascade has neither fines_ratio nor classification_ratio",
        ),
        ({"fines_ratio": 0.5, "fines_size_um": 50}, "fines_ratio = 0.5: must be greater than or equal to 1"),
    ],
)
def test_wrong_options_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        api.crystallizer(**{**ALUM, **changes})


def test_stages_that_do_not_match_are_refused() -> None:
    with pytest.raises(CrystallizerError, match="2 residence times and 1 slurry concentrations"):
        api.crystallizer(**{**ALUM, "residence_time_min": [5, 5]})
    with pytest.raises(CrystallizerError, match="classification_size = 1e-05 m: must be at least fines_size"):
        api.crystallizer(fines_ratio=2, fines_size_um=50, classification_ratio=2, classification_size_um=10, **ALUM)
