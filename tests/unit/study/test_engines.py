"""Engines of a block of points, and packings checked by another engine."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from filtercake.errors import ConfigError
from filtercake.results.cross_check import Agreement, agreement
from filtercake.study import engine_choice
from filtercake.study.cross_check import drawn
from filtercake.study.engine_choice import choose
from filtercake.study.points import base_rows, expand, points_table


def _with_sweeps(study: str, sweeps: str) -> str:
    return study[: study.index("sweeps:")] + sweeps


def _install(nowhere: Path) -> None:
    program = nowhere / "liggghts"
    program.write_text("#!/bin/sh\n", encoding="utf-8")
    program.chmod(0o755)


BOTH = """\
sweeps:
  - {csd: bimodal, engine: [embedded, liggghts], replicates: 8}
  - {csd: bimodal, cohesion_kJ_m3: [0, 50]}
"""


class TestEnginesOfABlock:
    def test_each_packs_its_points_and_the_studys_own_keep_their_names(
        self, nowhere: Path, study_from: Callable[..., Any], good_study: str
    ) -> None:
        _install(nowhere)
        plain = expand(study_from(_with_sweeps(good_study, BOTH.replace("engine: [embedded, liggghts], ", ""))), choose)
        study = engine_choice.of_this_machine(study_from(_with_sweeps(good_study, BOTH)))
        points = expand(study, choose)
        assert study.warnings == () and {p.name for p in plain} < {p.name for p in points}
        (other,) = (p for p in points if p.scene.engine == "liggghts")
        assert "_liggghts_" in other.name and other.replicates == 8
        # the base point is in both blocks, and visited once
        own = [p for p in points if p.scene.engine == "embedded"]
        assert len(own) == 2 and sorted(p.replicates for p in own) == [3, 8]

    def test_one_that_is_missing_is_left_out_and_said(
        self, nowhere: Path, study_from: Callable[..., Any], good_study: str
    ) -> None:
        study = engine_choice.of_this_machine(study_from(_with_sweeps(good_study, BOTH)))
        (warning,) = study.warnings
        assert "sweeps[0].engine: nothing is packed by liggghts: LIGGGHTS is not" in warning
        assert {p.scene.engine for p in expand(study, choose)} == {"embedded"}
        alone = study_from(_with_sweeps(good_study, BOTH.replace("[embedded, liggghts]", "liggghts")))
        with pytest.raises(ConfigError, match=r"sweeps\[0\]\.engine = liggghts: an engine that runs on this machine"):
            engine_choice.of_this_machine(alone)

    @pytest.mark.parametrize(
        ("block", "more", "says"),
        [
            ("engine: [lammps]", "", r"sweeps\[0\]\.engine\[0\] = 'lammps': allowed: 'auto', 'embedded'"),
            ("engine: []", "", r"sweeps\[0\]\.engine"),
            (
                "engine: [liggghts], protocol: filtration, pressure_kPa: 50",
                "",
                "cakes are pressed by the embedded engine",
            ),
            ("engine: [liggghts_as_published]", "packing: {bed_depth_factor: 2}\n", "it has the paper's own box"),
            ("engine: [liggghts], restitution: 0.01", "", "LIGGGHTS takes only more than 0.05"),
        ],
    )
    def test_what_an_engine_cannot_pack_is_refused(
        self, study_from: Callable[..., Any], good_study: str, block: str, more: str, says: str
    ) -> None:
        with pytest.raises(ConfigError, match=says):
            study_from(_with_sweeps(good_study, f"sweeps:\n  - {{csd: bimodal, {block}}}\n") + more)


class TestCrossCheck:
    def study(self, study_from: Callable[..., Any], good_study: str, packings: int) -> Any:
        sweeps = "sweeps:\n  - {csd: bimodal, cohesion_kJ_m3: [0, 10, 50, 100], replicates: 3}\n"
        return study_from(
            f"{_with_sweeps(good_study, sweeps)}cross_check: {{engine: liggghts, packings: {packings}}}\n"
        )

    def test_points_are_drawn_by_seed_each_once_before_any_twice(
        self, study_from: Callable[..., Any], good_study: str
    ) -> None:
        study = self.study(study_from, good_study, 3)
        points = expand(study, choose)
        pairs = drawn(study, points)
        assert len(pairs) == 3 and pairs == drawn(study, points[::-1])
        for own, other in pairs:
            assert other.replicates == 1 and other.name == f"{own.name}_liggghts"
            assert (own.scene.engine, other.scene.engine) == ("embedded", "liggghts")
            assert dataclasses.replace(other.scene, engine="embedded") == own.scene
        counts = [other.replicates for _, other in drawn(self.study(study_from, good_study, 6), points)]
        assert sorted(counts) == [1, 1, 2, 2]
        # there are no more packings than the study has
        assert sum(other.replicates for _, other in drawn(self.study(study_from, good_study, 100), points)) == 12

    def test_no_point_is_drawn_more_often_than_it_has_packings(
        self, study_from: Callable[..., Any], good_study: str
    ) -> None:
        sweeps = (
            "sweeps:\n  - {csd: bimodal, cohesion_kJ_m3: 0, replicates: 1}\n"
            "  - {csd: bimodal, cohesion_kJ_m3: 50, replicates: 4}\n"
        )
        study = study_from(f"{_with_sweeps(good_study, sweeps)}cross_check: {{engine: liggghts, packings: 4}}\n")
        counts = {own.scene.cohesion: other.replicates for own, other in drawn(study, expand(study, choose))}
        assert counts == {0.0: 1, 50e3: 3}

    def test_a_missing_engine_checks_nothing_and_says_so(
        self, nowhere: Path, study_from: Callable[..., Any], good_study: str
    ) -> None:
        study = engine_choice.of_this_machine(self.study(study_from, good_study, 3))
        assert study.model.cross_check is None
        assert "cross_check.engine: nothing is checked by liggghts" in study.warnings[-1]

    @pytest.mark.parametrize(
        ("text", "says"),
        [
            ("{engine: auto}", "must be named"),
            ("{engine: liggghts_as_published}", "has spheres of its own"),
            ("{engine: liggghts, packings: 1}", "cross_check.packings"),
            ("{packings: 3}", "cross_check.engine"),
        ],
    )
    def test_what_cannot_be_checked_is_refused(
        self, study_from: Callable[..., Any], good_study: str, text: str, says: str
    ) -> None:
        with pytest.raises(ConfigError, match=says):
            study_from(f"{good_study}cross_check: {text}\n")


def test_base_rows_are_of_the_studys_own_engine(nowhere: Path, study_from: Callable[..., Any], good_study: str) -> None:
    _install(nowhere)
    study = study_from(_with_sweeps(good_study, BOTH))
    table = points_table(expand(study, choose))
    assert base_rows(study.model, table)["engine"].tolist() == ["embedded"]
    assert sorted(base_rows(study.model, table, ("engine",))["engine"]) == ["embedded", "liggghts"]
    # where its own packed nothing, the one that did
    theirs = table[table["engine"] == "liggghts"]
    assert base_rows(study.model, theirs)["engine"].tolist() == ["liggghts"]


class TestAgreement:
    def table(self, *differences: float) -> pd.DataFrame:
        row = {"point": "p", "engine": "embedded", "other_engine": "liggghts"}
        return pd.DataFrame([{**row, "replicate": k, "difference": d} for k, d in enumerate(differences)])

    def test_is_the_paired_interval(self) -> None:
        found = agreement(self.table(0.001, -0.002, 0.0025))
        assert (found.engine, found.other, found.pairs) == ("embedded", "liggghts", 3)
        assert found.difference == pytest.approx(0.0005)
        assert found.ci95 == pytest.approx(4.302653 * np.std([0.001, -0.002, 0.0025], ddof=1) / np.sqrt(3.0))
        assert found.is_nought and found.words.endswith("(3 packings of the same clouds): no difference is seen")

    def test_a_difference_is_a_warning(self) -> None:
        found = agreement(self.table(0.011, 0.012, 0.0115))
        assert not found.is_nought and "WARNING: the engines differ" in found.words

    def test_failed_packings_are_no_pairs(self) -> None:
        found = agreement(self.table(0.001, np.nan))
        assert found.pairs == 1 and "too few to tell a difference" in found.words
        assert isinstance(agreement(self.table(np.nan, np.nan)), Agreement)
