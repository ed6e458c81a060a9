"""How far the instant estimate holds: against packings that were held out, and against ensembles made for other ends.

One table holds every packing of the design, trained on or held out; everything here follows from it.
"""

from __future__ import annotations

import contextlib
import json
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from filtercake.api.predictions import predict
from filtercake.api.steps import distribution
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.design.emulator import FEATURES, FRICTION, MEANINGS, CurveEstimate, Emulator, features_of
from filtercake.design.packing_features import SHAPE_FEATURES, counting_spheres, shape_features
from filtercake.errors import ConfigError
from filtercake.packing.compression import LOADS
from filtercake.packing.scene import FILTRATION_PROTOCOL, GRAVITY_PROTOCOL, Scene
from filtercake.statistics import quantile
from filtercake.units import MICROMETRE, FloatArray
from filtercake.validation.emulator_design import (
    HELD_OUT,
    TRAINING,
    UNSEEN,
    Member,
    cell_scene,
    described,
    settled_scene,
)
from filtercake.validation.emulator_fit import Training, left_out, train

PROTOCOLS: Final = (FILTRATION_PROTOCOL, GRAVITY_PROTOCOL)
AT_LOAD: Final = tuple("porosity" if math.isinf(x) else f"porosity_x{x:g}" for x in LOADS)
"""Columns of the porosity by load; that of settled beds is the last."""
PACKING_COLUMNS: Final = (
    "protocol",
    "role",
    "family",
    "seed",
    "replicate",
    "particles",
    "bed_depth_factor",
    "friction",
    "attraction",
    "cohesion_kJ_m3",
    "density_kg_m3",
    "mixture",
    *AT_LOAD,
    "seconds",
    "reason",
)
HELD_OUT_COLUMNS: Final = (
    *("protocol", "family", "particles", "bed_depth_factor"),
    *("friction", "attraction", "cohesion_kJ_m3", "density_kg_m3", "mixture"),
    *("load", "drawn", "porosity", "estimate", "error", "mean_ci95", "packing_ci95", "inside", "outside"),
)
"""``drawn``: whether this load was drawn to stand for the packing; ``inside``: within the interval of one packing."""
WANTED: Final = {"inside": 0.9, "error": 0.004, "half": 0.012}
"""Share of held-out packings in their intervals at least, and medians of error and half-width at most."""
ATTRACTIONS: Final = {"adhesion": "adhesion_mJ_m2", "cohesion": "cohesion_kJ_m3"}
LIMIT_MS: Final = 50.0
"""Time that an estimate may take, ms."""
BEYOND: Final = {"spread": 0.8, FRICTION: 0.8}
"""Features of which the upper part is left out of a training, and its quantile."""

Models = Mapping[str, Emulator]
Row = Mapping[Any, Any]
"""Of a table, by column."""


def tabulate(folder: Path, listed: Iterable[Member]) -> pd.DataFrame:
    """Read what ``folder`` holds of the design; one row, ``PACKING_COLUMNS``, per packing in the design's order."""
    rows = []
    for member in listed:
        path = folder / member.name
        if not path.exists():
            continue
        kept = json.loads(path.read_text(encoding="utf-8"))
        porosity = (
            dict(zip(AT_LOAD[-len(kept["porosity"]) :], kept["porosity"], strict=True)) if kept["porosity"] else {}
        )
        plain = described(member)
        sizes = zip(plain.pop("size_um"), plain.pop("volume_fraction"), strict=True)
        mixture = ",".join(f"{size:.7g}:{share:.7g}" for size, share in sizes)
        rows.append({**plain, "mixture": mixture, **porosity, "seconds": kept["seconds"], "reason": kept["reason"]})
    return pd.DataFrame(rows, columns=list(PACKING_COLUMNS))


def read_packings(path: Path) -> pd.DataFrame:
    """Read the table of :func:`tabulate`."""
    table = pd.read_csv(path, dtype={"reason": str})
    return table.assign(reason=table["reason"].fillna(""))


def accepted(table: pd.DataFrame, protocol: str, role: str) -> pd.DataFrame:
    """Rows of accepted packings of a protocol and role."""
    return table[(table["reason"] == "") & (table["protocol"] == protocol) & (table["role"] == role)]


def scene_of(row: Row) -> Scene:
    """Make the scene of a row of the table."""
    pairs = [tuple(map(float, pair.split(":"))) for pair in row["mixture"].split(",")]
    size, share = np.array(pairs).T
    csd = CrystalSizeDistribution.from_classes(size * MICROMETRE, share)
    friction, seed = float(row["friction"]), int(row["seed"])
    if row["protocol"] == FILTRATION_PROTOCOL:
        return cell_scene(csd, friction, row["attraction"], int(row["particles"]), seed)
    material = {"friction": friction, **{name: float(row[name]) for name in ("cohesion_kJ_m3", "density_kg_m3")}}
    scene = settled_scene(csd, csd.sauter_mean / MICROMETRE, material, seed)
    # as it was made: the last digits of the sizes may decide how large a bed a distribution is given
    return replace(scene, particles=int(row["particles"]), bed_depth_factor=float(row["bed_depth_factor"]))


def training(rows: pd.DataFrame) -> Training:
    """Take from rows of one protocol what a model is trained on."""
    scenes = [scene_of(row) for row in rows.to_dict("records")]
    columns = AT_LOAD if rows["protocol"].iloc[0] == FILTRATION_PROTOCOL else AT_LOAD[-1:]
    alike = rows.groupby(["mixture", "friction", "cohesion_kJ_m3", "density_kg_m3"], dropna=False, sort=False).ngroup()
    return Training(
        features=np.array([features_of(scene) for scene in scenes]),
        porosity=rows[list(columns)].to_numpy(np.float64),
        spheres=np.array([counting_spheres(scene.csd, scene.particles) for scene in scenes]),
        group=np.asarray(alike.to_numpy(), dtype=np.int64),
    )


def trained(table: pd.DataFrame, protocol: str, first: int | None = None) -> Emulator:
    """Train the model of a protocol on the table's training packings, or on the first so many."""
    rows = accepted(table, protocol, TRAINING)
    return _trained(rows if first is None else rows.head(first), protocol)


def _trained(rows: pd.DataFrame, protocol: str) -> Emulator:
    load = np.array(LOADS if protocol == FILTRATION_PROTOCOL else LOADS[-1:])
    return train(protocol, load, training(rows))


def held_out(models: Models, table: pd.DataFrame, draw: int) -> pd.DataFrame:
    """Hold the models against packings that they were not trained on.

    Returns
    -------
    DataFrame
        ``HELD_OUT_COLUMNS``; one row per packing and load. One load of each is drawn at random.
    """
    random = np.random.default_rng([draw, 60])
    rows = table[(table["role"] == HELD_OUT) & (table["reason"] == "")]
    found: list[dict[str, Any]] = []
    for row in rows.to_dict("records"):
        found += _against(models[row["protocol"]], row, random)
    return pd.DataFrame(found, columns=list(HELD_OUT_COLUMNS))


def _against(model: Emulator, row: Row, random: np.random.Generator) -> list[dict[str, Any]]:
    """Hold a model against one packing, at all of its loads."""
    asked = {name: row[name] for name in HELD_OUT_COLUMNS[:9]}
    try:
        estimate = model.estimate(scene_of(row))
    except ConfigError as error:
        return [{**asked, "drawn": True, "inside": False, "outside": f"refused: {error.problems[0].allowed}"}]
    porosity = np.array([row[name] for name in AT_LOAD[-estimate.load.size :]])
    mean_half, half = half_widths(estimate)
    off = porosity - estimate.porosity
    drawn = int(random.integers(estimate.load.size))
    return [
        {
            **asked,
            "load": estimate.load[k],
            "drawn": k == drawn,
            "porosity": porosity[k],
            "estimate": estimate.porosity[k],
            "error": off[k],
            "mean_ci95": mean_half[k],
            "packing_ci95": half[k],
            "inside": bool(abs(off[k]) <= half[k]),
            "outside": "; ".join(estimate.outside),
        }
        for k in range(estimate.load.size)
    ]


def half_widths(estimate: CurveEstimate) -> tuple[FloatArray, FloatArray]:
    """Half-widths of the 95 % intervals at each load: of many packings' mean, and of one packing."""
    unknown, scatter = np.diag(estimate.unknown), np.diag(estimate.scatter)
    return quantile() * np.sqrt(unknown), quantile() * np.sqrt(unknown + scatter)


def verdicts(held: pd.DataFrame) -> pd.DataFrame:
    """Sum up held-out packings, by what they are: label, n, inside, error, half, mean_half, bias, holds.

    All but the last row count one load of each packing, that which was drawn.
    """
    drawn = held[held["drawn"].astype(bool)]
    pressed, bare = held["protocol"] == FILTRATION_PROTOCOL, held["attraction"] == "none"
    one = drawn.index
    sets = {
        "all": drawn,
        "pressed cells, led through the loads": drawn[pressed[one] & ~bare[one]],
        "pressed cells without attraction": drawn[pressed[one] & bare[one]],
        "settled beds": drawn[~pressed[one]],
        "pressed cells of kinds not trained on": drawn[pressed[one] & drawn["family"].isin(UNSEEN)],
        "pressed cells without friction": drawn[pressed[one] & (drawn["friction"] == 0.0)],
        "pressed cells, every load": held[pressed],
    }
    return pd.DataFrame([{"label": label, **_verdict(rows)} for label, rows in sets.items() if len(rows)])


def _verdict(rows: pd.DataFrame) -> dict[str, Any]:
    found = {
        "n": len(rows),
        "inside": int(rows["inside"].sum()),
        "error": float(rows["error"].abs().median()),
        "half": float(rows["packing_ci95"].median()),
        "mean_half": float(rows["mean_ci95"].median()),
        "bias": float(rows["error"].mean()),
    }
    good = found["inside"] >= WANTED["inside"] * found["n"]
    return {**found, "holds": good and all(found[name] <= WANTED[name] for name in ("error", "half"))}


def by_load(model: Emulator, data: Training) -> pd.DataFrame:
    """Leave each training packing out in turn: load, n, rms (error), half (width for one packing), inside (share)."""
    found = left_out(model, data)
    off = found.porosity - found.mean
    half = quantile() * np.hypot(model.widening * found.unknown, found.scatter)
    inside = np.where(np.isfinite(off), np.abs(off) <= half, np.nan)
    return pd.DataFrame(
        {
            "load": model.load,
            "n": np.isfinite(off).sum(axis=0),
            "rms": np.sqrt(np.nanmean(off**2, axis=0)),
            "half": np.nanmedian(half, axis=0),
            "inside": np.nanmean(inside, axis=0),
        }
    )


def left_one_out(table: pd.DataFrame, model: Emulator) -> pd.DataFrame:
    """Leave each packing of the table's training out in turn (:func:`by_load`)."""
    return by_load(model, training(accepted(table, model.protocol, TRAINING)))


def ranges(model: Emulator) -> list[tuple[str, str, str]]:
    """Meaning, smallest and largest value of each feature that a model was trained on."""
    found = []
    for name, low, high in zip(FEATURES[model.protocol], model.lowest, model.highest, strict=True):
        if name in MEANINGS:
            _, meaning, shown = MEANINGS[name]
            found.append((meaning, f"{shown(float(low)):.3g}", f"{shown(float(high)):.3g}"))
    return found


def widths(table: pd.DataFrame, protocol: str) -> dict[str, float]:
    """Say how wide distributions were trained on.

    Returns
    -------
    dict
        ``spheres`` (most of a packing); largest over smallest size, of all (``ratio``), of two sizes (``two``) and of
        two sizes with a quarter of fines or more (``with_fines``); geometric standard deviation of a lognormal
        (``lognormal``), as it was cut.
    """
    rows = accepted(table, protocol, TRAINING)
    csds = [scene_of(row).csd for row in rows.to_dict("records")]
    ratio = np.array([csd.largest / csd.smallest for csd in csds])
    fine = np.array([csd.volume_fraction[0] for csd in csds])
    spread = np.array([shape_features(csd)[SHAPE_FEATURES.index("spread")] for csd in csds])
    two, lognormal = (rows["family"].to_numpy() == name for name in ("two sizes", "lognormal"))
    return {
        "spheres": float(rows["particles"].max()),
        "ratio": float(ratio.max()),
        "two": float(ratio[two].max()),
        "with_fines": float(ratio[two & (fine >= 0.25)].max()),
        "lognormal": math.exp(float(spread[lognormal].max())),
    }


def counts(table: pd.DataFrame) -> pd.DataFrame:
    """Count packings by protocol, role and attraction: n, rejected, spheres (fewest, most), hours of CPU time."""
    found = []
    kind = np.where(table["attraction"] == "none", "none", "some")
    for key, rows in table.groupby(["protocol", "role", kind], sort=False):
        found.append(
            {
                **dict(zip(("protocol", "role", "attraction"), key, strict=True)),
                "n": len(rows),
                "rejected": int((rows["reason"] != "").sum()),
                "fewest": int(rows["particles"].min()),
                "most": int(rows["particles"].max()),
                "hours": float(rows["seconds"].sum()) / 3600.0,
            }
        )
    return pd.DataFrame(found)


def learning(table: pd.DataFrame, draw: int, shares: Sequence[float] = (0.25, 0.5)) -> pd.DataFrame:
    """Train on the first part of the design only: protocol, packings, n, inside, error and half of what is held out."""
    found = []
    for protocol in PROTOCOLS:
        rows = accepted(table, protocol, TRAINING)
        for share in shares:
            model = trained(table, protocol, int(share * len(rows)))
            own = table[table["protocol"] == protocol]
            held = held_out({protocol: model}, own, draw)
            found.append(
                {"protocol": protocol, "packings": model.packings, **_verdict(held[held["drawn"].astype(bool)])}
            )
    return pd.DataFrame(found)


def beyond(table: pd.DataFrame) -> pd.DataFrame:
    """Train without the upper part of a feature, and estimate that part.

    Returns
    -------
    DataFrame
        protocol, feature, limit (where the training ends), n (packings beyond), refused, said (estimates that say that
        they are outside), inside (share of the estimates at all loads that are in their intervals), half (median).
    """
    return pd.DataFrame([_beyond(table, protocol, name) for protocol in PROTOCOLS for name in BEYOND])


def _beyond(table: pd.DataFrame, protocol: str, name: str) -> dict[str, Any]:
    rows = accepted(table, protocol, TRAINING)
    values = training(rows).features[:, FEATURES[protocol].index(name)]
    limit = float(np.quantile(values, BEYOND[name]))
    model = _trained(rows[values <= limit], protocol)
    rest = table.loc[rows.index[values > limit]].assign(role=HELD_OUT)
    held = held_out({protocol: model}, rest, 0)
    refused = held["outside"].str.startswith("refused")
    given = held[~refused]
    return {
        "protocol": protocol,
        "feature": name,
        "limit": limit if name != FRICTION else _friction(rows, values <= limit),
        "n": len(rest),
        "refused": int(refused.sum()),
        "said": int((given["drawn"].astype(bool) & (given["outside"] != "")).sum()),
        "inside": float(given["inside"].mean()) if len(given) else math.nan,
        "half": float(given["packing_ci95"].median()) if len(given) else math.nan,
    }


def _friction(rows: pd.DataFrame, kept: Any) -> float:
    return float(rows["friction"][kept].max())


def ensembles(models: Models, means: pd.DataFrame) -> pd.DataFrame:
    """Hold estimated means against those of ensembles of cells (docs/data/pressure.csv).

    One size at eight frictions, pressed at once without cohesion, and 20/50 um 50/50 whose cohesion was weakened.

    Returns
    -------
    DataFrame
        label, friction, load, n, porosity, se, estimate, error, ci95 (of the error: the estimate's and the ensemble's),
        inside.
    """
    at_rest = means[(means["section"] == "friction") & (means["friction"] <= 1.0)]
    led = means[(means["section"] == "paths") & means["case"].str.startswith("cohesion_")]
    rows = [_ensemble(models, row, {30.0: 1.0}, "none") for row in at_rest.to_dict("records")]
    rows += [_ensemble(models, row, {20.0: 0.5, 50.0: 0.5}, "cohesion") for row in led.to_dict("records")]
    return pd.DataFrame(rows)


def _ensemble(models: Models, row: Row, mixture: Mapping[float, float], attraction: str) -> dict[str, Any]:
    csd = distribution(mixture=dict(mixture)).truncated
    scene = cell_scene(csd, row["friction"], attraction, int(row["spheres"]), 1)
    model = models[FILTRATION_PROTOCOL]
    found = model.estimate(scene)
    load = np.array([math.inf if attraction == "none" else row["load"]])
    estimate = float(found.curve.at(load)[0])
    mean_half, half = found.half_widths(lambda curve: float(curve.at(load)[0]))
    # of an ensemble's mean: its own error, from the scatter of one packing that the model knows
    scatter = (half**2 - mean_half**2) / row["n"]
    off, ci95 = row["porosity"] - estimate, math.sqrt(mean_half**2 + scatter)
    return {
        "label": row["label"] if attraction == "none" else f"20/50 um, friction {row['friction']:g}",
        "friction": row["friction"],
        "load": float(load[0]),
        "n": int(row["n"]),
        "porosity": row["porosity"],
        "estimate": estimate,
        "error": off,
        "mean_ci95": mean_half,
        "ci95": ci95,
        "inside": abs(off) <= ci95,
    }


def pace(table: pd.DataFrame, calls: int = 40) -> float:
    """Median CPU time of an estimate, its checks included, over ``LIMIT_MS``; of held-out cells, after the first."""
    rows = accepted(table, FILTRATION_PROTOCOL, HELD_OUT).head(calls)
    times = []
    for row in rows.to_dict("records"):
        source = distribution(mixture=[pair.split(":") for pair in row["mixture"].split(",")])
        attraction = {} if row["attraction"] == "none" else {ATTRACTIONS[row["attraction"]]: 10.0}
        started = time.process_time()
        with contextlib.suppress(ConfigError):  # a refusal is an answer, too
            predict(source, friction=row["friction"], density_kg_m3=row["density_kg_m3"], **attraction)
        times.append(time.process_time() - started)
    return float(np.median(times[1:])) * 1e3 / LIMIT_MS
