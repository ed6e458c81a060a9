"""A design that makes no sense is refused before any job, with file, key, value and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from filtercake.design.confirm import BATCHES
from filtercake.design.loading import LoadedDesign, levels_of, load_design, load_designs
from filtercake.errors import ConfigError
from filtercake.study import engine_choice
from filtercake.study.loading import load_study

REPOSITORY = Path(__file__).resolve().parents[3]
GOOD = """\
crystallizer:
  kinetics: ammonium_alum
  slurry_concentration_kg_m3: 200
filter:
  pressure_drop_kPa: 53.32
  submerged_fraction: 0.3
  rotation_rate_rpm: 0.2
  medium_resistance_1_m: 5.0e+9
material:
  friction: 0
  adhesion_mJ_m2: 0
resistance_law: carman
packing:
  protocol: filtration
  replicates: 2
sweeps:
  - residence_time_min: 30
design:
  variables:
    residence_time_min: [15, 60]
"""
KINETICS = """\
mine:
  nucleation_coefficient: 9.0e+16
  units: "B0 #/(L s), MT g/L, G m/s"
  slurry_concentration_exponent: 1.4
  growth_rate_exponent: 2
  shape_factor: 1
  density_kg_m3: 2450
  residence_time_range_min: null
  source: made up
"""
COSTS = """\
correlations:
  my_filter:
    title: mine
    equipment: drum_filter
    formula: power
    coefficients: [10000, 0.5]
    size_unit: m2
    size_range: null
    cost_index: 500
    index_year: 2000
    installed_factor: 2
    installed_as: installed
    source: mine
"""


def loaded(folder: Path, text: str = GOOD) -> LoadedDesign:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_design(load_study(path))


def extended(more: str) -> str:
    return GOOD + "".join(f"  {line}\n" for line in more.splitlines())


def test_a_good_design_lists_what_may_be_packed(tmp_path: Path) -> None:
    design = loaded(tmp_path)
    assert design.levels[0] == 15.0 and design.levels[-1] == 60.0 and len(design.levels) == 13
    ratios = [b / a for a, b in zip(design.levels, design.levels[1:], strict=False)]
    assert ratios == pytest.approx([4.0 ** (1 / 12)] * 12, rel=0.01)
    asks = design.asks(engine_choice.choose)
    assert len(asks) == BATCHES * 13 and len({ask.point.packings for ask in asks}) == len(asks)
    assert [asks[k].level for k in (0, 12, 13)] == [0, 12, 0] and asks[13].batch == 1
    assert all(ask.point.residence_time_min == design.levels[ask.level] for ask in asks)
    assert set(design.correlations) == {
        "drum_filter_turton",
        "drum_filter_seider",
        "batch_evaporative_crystallizer_turton",
    }


def test_packings_of_the_sweeps_serve_the_design(tmp_path: Path) -> None:
    """The design's first set at a residence time is what a sweep packs there."""
    from filtercake.study.points import expand

    design = loaded(tmp_path)
    own = {point.packings for point in expand(load_study(tmp_path / "mine.yaml"), engine_choice.choose)}
    assert own < {ask.point.packings for ask in design.asks(engine_choice.choose)}


def test_the_ends_are_kept_as_they_are_given(tmp_path: Path) -> None:
    text = GOOD.replace("[15, 60]", "[15.1234, 15.6]") + "  levels: 9\n"
    design = loaded(tmp_path, text)
    assert design.levels == levels_of(design.model)
    assert design.levels[0] == 15.1234 and design.levels[-1] == 15.6
    assert list(design.levels) == sorted(set(design.levels))


def test_costs_of_ones_own_stand_beside_the_others(tmp_path: Path) -> None:
    (tmp_path / "costs.yaml").write_text(COSTS, encoding="utf-8")
    design = loaded(tmp_path, extended("costs: {file: costs.yaml, filter: my_filter}"))
    assert "my_filter" in design.correlations and "drum_filter_turton" in design.correlations


BROKEN = {
    "descending": (
        ("[15, 60]", "[60, 15]"),
        "design.variables.residence_time_min = [60, 15]: must be the lowest, then",
    ),
    "one value": (("[15, 60]", "[15]"), "residence_time_min = [15]: must hold at least 2 values"),
    "three values": (("[15, 60]", "[15, 30, 60]"), "residence_time_min = [15, 30, 60]: must have at most 2 items"),
    "unknown key": (("  variables:", "  variable: {}\n  variables:"), "did you mean variables?"),
    "unknown variable": (("    residence", "    rotation_rpm: [1, 2]\n    residence"), "unknown key"),
    "no filter": (("filter:\n", "published: []\nfilter_: \n"), "unknown key"),
    "law": (("law: carman", "law: stokes\npermeability: {packings: 1}"), "resistance_law = 'stokes': no design solves"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_wrong_is_named(tmp_path: Path, case: str) -> None:
    (old, new), said = BROKEN[case]
    assert old in GOOD
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, GOOD.replace(old, new))
    assert said in str(error.value) and "mine.yaml" in str(error.value)


ADDED = {
    "objective: cost": "design.objective = 'cost': allowed: 'installed_cost', 'purchase_cost'",
    "trade_off: installed_cost": "trade_off must be another objective",
    "objective: cake_moisture": "cake_moisture needs deliquoring_share and surface_tension_mN_m",
    "deliquoring_share: 0.8": "design.deliquoring_share = 0.8: must leave room beside the 0.3 of the drum",
    "packings: 1": "design.packings = 1: must be at least packing.replicates, 2",
    "levels: 2": "design.levels = 2: must be greater than or equal to 3",
    "costs: {crystallizer: drum_filter_turton}": "design.costs.crystallizer = 'drum_filter_turton': allowed: batch_",
    "costs: {filter: leaf_filter_turton}": "design.costs.filter = 'leaf_filter_turton': allowed: drum_filter_turton",
    "costs: {filter: drum_filter_turtn}": "did you mean drum_filter_turton?",
    "costs: {file: nowhere.yaml}": "nowhere.yaml",
    "constraints: {cake_thickness_mm: [50, 5]}": "must be the lowest, then the highest value",
    "constraints: {largest_medium_share: 1}": "largest_medium_share = 1: must be less than 1",
    "relative_ci95_target: 0": "relative_ci95_target = 0: must be greater than or equal to",
}


@pytest.mark.parametrize("more", ADDED)
def test_what_is_added_and_wrong_is_named(tmp_path: Path, more: str) -> None:
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, extended(more))
    assert ADDED[more] in str(error.value)


VARIABLES = {
    "filter_type: [drum, leaf]": "turnaround_min must be given for the filter types",
    "filter_type: [drum, drum]": "variables.filter_type names a type twice",
    "filter_type: press": "allowed: 'drum', 'leaf' or 'plate_and_frame'",
    "slurry_concentration_kg_m3: [100, 900]": "slurry_concentration_kg_m3[1] = 900: must be below 857.5 kg/m3",
    "submerged_fraction: [0.2, 1]": "must be less than 1",
    "pressure_drop_kPa: [20, 20000]": "pressure_drop_kPa[1] = 20000",
}


@pytest.mark.parametrize("more", VARIABLES)
def test_a_variable_that_is_wrong_is_named(tmp_path: Path, more: str) -> None:
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, GOOD.replace("  variables:\n", f"  variables:\n    {more}\n"))
    assert VARIABLES[more] in str(error.value)


def test_a_slurry_that_makes_other_crystals_is_refused(tmp_path: Path) -> None:
    (tmp_path / "kinetics.yaml").write_text(KINETICS, encoding="utf-8")
    text = GOOD.replace("ammonium_alum", "mine\n  kinetics_file: kinetics.yaml")
    loaded(tmp_path, text)
    with pytest.raises(ConfigError, match="the crystals themselves depend on it"):
        loaded(tmp_path, text.replace("  variables:\n", "  variables:\n    slurry_concentration_kg_m3: [100, 200]\n"))


def test_crystals_too_far_from_all_that_was_packed_are_refused(tmp_path: Path) -> None:
    beds = GOOD.replace("  adhesion_mJ_m2: 0\n", "").replace("protocol: filtration", "initial_void_fraction: 0.6")
    loaded(tmp_path, beds)
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, beds.replace("0.6\n", "0.6\n  particles: 200000\n  bed_depth_factor: 10\n"))
    for end, problem in enumerate(error.value.problems):
        assert problem.key == f"design.variables.residence_time_min[{end}]"
        assert problem.allowed.endswith("too far off for an estimate")


def test_a_design_without_crystallizer_and_filter_names_both(tmp_path: Path) -> None:
    text = (
        "csds:\n  one: {mixture: [{size_um: 50, volume_fraction: 1}]}\nmaterial: {density_kg_m3: 2000}\n"
        "sweeps:\n  - csd: one\n" + GOOD[GOOD.index("design:") :]
    )
    with pytest.raises(ConfigError) as error:
        loaded(tmp_path, text)
    assert {problem.key for problem in error.value.problems} == {"crystallizer", "filter"}


def test_problems_of_all_designs_are_told_together(tmp_path: Path) -> None:
    studies = []
    for name in ("one", "other", "none"):
        path = tmp_path / f"{name}.yaml"
        path.write_text(GOOD[: GOOD.index("design:")] if name == "none" else extended("packings: 1"), encoding="utf-8")
        studies.append(load_study(path))
    with pytest.raises(ConfigError) as error:
        load_designs(studies)
    assert [Path(problem.file).stem for problem in error.value.problems] == ["one", "other"]
    with pytest.raises(ConfigError, match=r"design = \(missing\)"):
        load_design(studies[2])


@pytest.mark.parametrize("name", ["alum_design", "fine_design"])
def test_the_designs_that_come_along_are_good(name: str) -> None:
    assert load_design(load_study(REPOSITORY / "config" / "studies" / f"{name}.yaml")).levels
