"""What solved packings say of the laws: the Kozeny constant by distribution, exponents, and how much a constant covers.

The constant of Carman's law is ``A = eps^3 D^2 / (k (1 - eps)^2)``, D the Sauter mean diameter. Eq. 3 of the paper has
1/sum(x/d^2) for D^2: its constant is A over the ratio of sum(x/d^2) to (sum(x/d))^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import pandas as pd
import scipy

from filtercake.crystals.csd import mixture
from filtercake.filtration.resistance import KOZENY_CARMAN, carman_sauter, kozeny_carman
from filtercake.statistics import Spread, quantile
from filtercake.units import MICROMETRE, FloatArray
from filtercake.validation.permeability import BED, CELL, FINER, FINER_ENDING, LATTICE, LAYERED, MIXED, SECOND

CARMAN: Final = KOZENY_CARMAN
"""Constant that the paper has in its eq. 3: P. C. Carman, Trans. Inst. Chem. Eng. 15 (1937) 150."""
ERDIM: Final = 160.0
"""E. Erdim, O. Akgiray, I. Demir, Powder Technol. 283 (2015) 488."""
ERGUN: Final = 150.0
"""S. Ergun, Chem. Eng. Prog. 48 (1952) 89."""
REFERENCE_POROSITY: Final = 0.35
"""Porosity at which fits with different exponents are compared."""
MIXTURE, ONE_SIZE = "hard_mixed", "hard_0.50"
"""Cases of hard spheres with the spheres of the layers, and of one size with as much solids."""
MSMPR_RATIO: Final = math.gamma(4.0) * math.gamma(2.0) / math.gamma(3.0) ** 2
"""Sum of x/d^2 over (sum of x/d)^2 of an MSMPR crystallizer's product, all of it: x goes as d^3 exp(-d/(G tau))."""
PAPERS_POROSITY: Final = 0.358
"""Of the paper's simulated 25/75 PMMA cake (its Table 4)."""
MEASURED: Final = {"porosity": 0.38, "resistance": 1.48e9, "density": 1180.0}
"""The same cake measured (Bourcier et al., 2016): m/kg, kg/m3."""
FIT_COLUMNS: Final = ("packings", "fit", "quantity", "value", "ci95", "cases")


def van_der_hoef(porosity: FloatArray) -> FloatArray:
    """Return the Kozeny constant of random arrays of equal hard spheres (n,) at porosities (n,).

    Lattice Boltzmann fit, within 3 %: M. A. van der Hoef, R. Beetstra, J. A. M. Kuipers, J. Fluid Mech. 528 (2005) 233.

    Examples
    --------
    >>> van_der_hoef(np.array([0.55, 0.7])).round(1).tolist()
    [187.3, 206.2]
    """
    solids = 1.0 - porosity
    return np.asarray(CARMAN + 18.0 * porosity**4 * (1.0 + 1.5 * np.sqrt(solids)) / solids)


def spread(table: pd.DataFrame, kind: str = BED) -> Spread:
    """Relative standard deviation of A of one packing, times the root of its effective spheres.

    Pooled over the cases of a kind, each about its own mean; it includes what the nodes' places add.
    """
    squares, freedom = 0.0, 0.0
    for _, rows in table[table["kind"] == kind].groupby("case"):
        constant, weight = np.log(rows["kozeny_constant"]), rows["effective_spheres"]
        squares += float(np.sum(weight * (constant - np.average(constant, weights=weight)) ** 2))
        freedom += len(rows) - 1.0
    return Spread(math.sqrt(squares / freedom), freedom) if freedom else Spread(math.nan, 0.0)


def by_case(table: pd.DataFrame) -> pd.DataFrame:
    """Average the packings of each case, in the table's order.

    Returns
    -------
    DataFrame
        case, kind, label, n, spheres (of one packing), porosity, ratio, series, constant, packings_ci95 (between
        packings, relative), numerical_ci95 (relative), ci95 (both, absolute), eq3 and eq3_ci95 (the same by eq. 3's
        mean) and too_high (relative excess of eq. 3 with Carman's constant).
    """
    beds, cells = (spread(table, kind) for kind in MIXED)
    spreads = {BED: beds, FINER: beds, SECOND: beds, CELL: cells, LAYERED: cells, LATTICE: Spread(0.0, math.inf)}
    rows = []
    for (case, kind, label), packings in table.groupby(["case", "kind", "label"], sort=False):
        one = spreads[str(kind)]
        between = quantile(one.freedom) * one.sd / math.sqrt(float(packings["effective_spheres"].sum()))
        numerical = float(np.hypot(packings["resolution"], packings["convergence"]).mean())
        constant, eq3 = float(packings["kozeny_constant"].mean()), float(packings["kozeny_constant_eq3"].mean())
        whole = math.hypot(between, numerical)
        rows.append(
            {
                "case": case,
                "kind": kind,
                "label": label,
                "n": len(packings),
                "spheres": int(packings["spheres"].iloc[0]),
                "porosity": float(packings["porosity"].mean()),
                "ratio": float(packings["ratio"].mean()),
                "series": float(packings["series"].mean()),
                "constant": constant,
                "packings_ci95": between,
                "numerical_ci95": numerical,
                "ci95": whole * constant,
                "eq3": eq3,
                "eq3_ci95": whole * eq3,
                "too_high": CARMAN / eq3 - 1.0,
            }
        )
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Fit:
    """Fit of ``ln(k (1 - eps)^2 / D^2) = a ln eps - ln A + b ln ratio``; half-widths are 95 %.

    Attributes
    ----------
    exponent, exponent_ci95 : float
        a; half-width 0 where it was given.
    constant, constant_ci95 : float
        A times ``REFERENCE_POROSITY^(3 - a)``: what stands for A in Carman's law at that porosity.
    width, width_ci95 : float
        b: 0 by Carman's law, -1 by eq. 3.
    scatter : float
        Standard deviation of cases about the fit that their own errors do not explain.
    cases : int
        Cases.
    """

    exponent: float
    exponent_ci95: float
    constant: float
    constant_ci95: float
    width: float
    width_ci95: float
    scatter: float
    cases: int

    @property
    def bare_constant(self) -> float:
        """A itself: what the law would be at a porosity of 1."""
        return self.constant * math.exp((self.exponent - 3.0) * math.log(REFERENCE_POROSITY))


def fit(cases: pd.DataFrame, *, exponent: float | None = None) -> Fit:
    """Fit exponents and constant to averages of cases (:func:`by_case`), each case one observation.

    Its variance is that of its own error and a scatter between cases, chosen to fit the residuals.

    Parameters
    ----------
    cases : DataFrame
        porosity, ratio, constant and ci95.
    exponent : float or None
        a, where it is given; otherwise it is fitted.
    """
    porosity, ratio = np.log(cases["porosity"] / REFERENCE_POROSITY), np.log(cases["ratio"])
    # ln(k phi^2 / D^2) = 3 ln eps - ln A of each case
    known = 3.0 if exponent is None else exponent
    answer = (3.0 - known) * porosity - np.log(cases["constant"])
    columns = [np.ones(len(cases)), ratio] + ([porosity] if exponent is None else [])
    design = np.column_stack(columns)
    own = (cases["ci95"] / cases["constant"] / quantile()).to_numpy(np.float64)
    scatter = _scatter(design, answer.to_numpy(np.float64), own)
    found, error = _solve(design, answer.to_numpy(np.float64), own**2 + scatter**2)
    student = quantile(float(len(cases) - design.shape[1]))
    half = [student * value for value in error]
    constant = math.exp(-found[0])
    slope, slope_half = (known + found[2], half[2]) if exponent is None else (known, 0.0)
    return Fit(slope, slope_half, constant, constant * half[0], found[1], half[1], scatter, len(cases))


def _solve(design: FloatArray, answer: FloatArray, variance: FloatArray) -> tuple[list[float], list[float]]:
    """Weighted least squares: parameters and their standard errors."""
    covariance = np.linalg.inv(design.T @ (design / variance[:, None]))
    return (covariance @ design.T @ (answer / variance)).tolist(), np.sqrt(np.diag(covariance)).tolist()


def _scatter(design: FloatArray, answer: FloatArray, own: FloatArray) -> float:
    """Find the standard deviation between cases with which chi-square is as expected; 0 where it is less anyway."""
    freedom = design.shape[0] - design.shape[1]

    def excess(scatter: float) -> float:
        variance = own**2 + scatter**2
        residual = answer - design @ np.array(_solve(design, answer, variance)[0])
        return float(np.sum(residual**2 / variance) - freedom)

    return 0.0 if excess(0.0) <= 0.0 else float(scipy.optimize.brentq(excess, 0.0, 10.0))


@dataclass(frozen=True)
class Constant:
    """One constant for all distributions.

    Attributes
    ----------
    value, sd : float
        Mean over the cases, and the standard deviation between them.
    mean_ci95 : float
        Half-width of the mean.
    random_ci95 : float
        Half-width that holds a distribution taken at random: that of a prediction, not of the mean.
    numerical_ci95 : float
        What the numerical error adds where all cases share it.
    ci95 : float
        Both of them: the half-width to use.
    cases : int
        Cases.
    """

    value: float
    sd: float
    mean_ci95: float
    random_ci95: float
    numerical_ci95: float
    cases: int

    @property
    def ci95(self) -> float:
        """Half-width to use."""
        return math.hypot(self.random_ci95, self.numerical_ci95)


def overall(cases: pd.DataFrame, column: str) -> Constant:
    """Sum up a constant, ``constant`` or ``eq3``, of the cases (:func:`by_case`), each counting the same."""
    values, count = cases[column], len(cases)
    sd = float(values.std())
    student = quantile(count - 1.0) * sd
    return Constant(
        value=float(values.mean()),
        sd=sd,
        mean_ci95=student / math.sqrt(count),
        random_ci95=student * math.sqrt(1.0 + 1.0 / count),
        numerical_ci95=float((values * cases["numerical_ci95"]).mean()),
        cases=count,
    )


def mixed_beds(cases: pd.DataFrame) -> pd.DataFrame:
    """Select the settled beds."""
    return cases[cases["kind"] == BED]


def mixed(cases: pd.DataFrame) -> pd.DataFrame:
    """Select beds and hard spheres."""
    return cases[cases["kind"].isin(MIXED)]


def layers_by_law(cases: pd.DataFrame) -> pd.DataFrame:
    """Hold layers, and the same spheres mixed, against three laws.

    Returns
    -------
    DataFrame
        The layered rows of :func:`by_case` and the mixture's, with the Sauter mean's A that they would have by Carman's
        law for the whole cell (``carman``: that of one size), by eq. 3 for the whole cell (``additive``), and by
        Carman's law for slices in series (``slices``).
    """
    one = float(cases.loc[cases["case"] == ONE_SIZE, "constant"].iloc[0])
    rows = cases[(cases["kind"] == LAYERED) | (cases["case"] == MIXTURE)]
    return rows.assign(carman=one, additive=one * rows["ratio"], slices=one * rows["series"])


def finer(table: pd.DataFrame) -> pd.DataFrame:
    """Hold beds solved on fine lattices against the same beds as they are in the averages.

    Returns
    -------
    DataFrame
        case, replicate, label, nodes (per mean diameter, on the finest lattice), constant and numerical_ci95 (relative)
        as in the averages; finer_nodes, finer and finer_ci95 on the fine lattices; change, the relative difference; and
        whether the stated error covers it.
    """
    listed = table.assign(
        numerical=np.hypot(table["resolution"], table["convergence"]),
        nodes=table["diameters_per_spacing"].astype(str).str.split().str[-1].astype(float),
        case=table["case"].str.removesuffix(FINER_ENDING),
    )
    keys = ["case", "replicate"]
    columns = [*keys, "label", "nodes", "kozeny_constant", "numerical"]
    before, again = (listed.loc[listed["kind"] == kind, columns] for kind in (BED, FINER))
    found = before.merge(again.drop(columns="label"), on=keys, suffixes=("", "_finer"))
    found["change"] = found["kozeny_constant_finer"] / found["kozeny_constant"] - 1.0
    found["covered"] = found["change"].abs() <= found["numerical"]
    return found.rename(
        columns={
            "kozeny_constant": "constant",
            "numerical": "numerical_ci95",
            "nodes_finer": "finer_nodes",
            "kozeny_constant_finer": "finer",
            "numerical_finer": "finer_ci95",
        }
    )


def both_methods(table: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Put the beds of the second method (columns of its table) beside what this one finds of them.

    Returns
    -------
    DataFrame
        bed, porosity and constant with numerical_ci95 (relative) of this method; other_porosity, other and other_ci95
        of the second one; and difference, relative.
    """
    ours = table[table["kind"] == SECOND]
    found = ours.merge(other, left_on="label", right_on="bed", suffixes=("", "_other"))
    return pd.DataFrame(
        {
            "bed": found["bed"],
            "porosity": found["porosity"],
            "constant": found["kozeny_constant"],
            "numerical_ci95": np.hypot(found["resolution"], found["convergence"]),
            "other_porosity": found["porosity_other"],
            "other": found["kozeny_constant_other"],
            "other_ci95": found["relative_error"],
            "difference": found["kozeny_constant"] / found["kozeny_constant_other"] - 1.0,
        }
    )


def papers_mixture(constant: float) -> dict[str, float]:
    """Resistance (m/kg) of the paper's 25/75 mixture by both laws, at its own porosity and at the measured one."""
    csd = mixture([20.0 * MICROMETRE, 50.0 * MICROMETRE], [0.25, 0.75])
    density = MEASURED["density"]
    found = {"measured": MEASURED["resistance"], "measured_porosity": MEASURED["porosity"]}
    for name, porosity in (("simulated", PAPERS_POROSITY), ("at_measured", MEASURED["porosity"])):
        found[f"eq3_{name}"] = kozeny_carman(porosity, csd, density)
        found[f"sauter_{name}"] = constant / CARMAN * carman_sauter(porosity, csd, density)
    return {**found, "simulated_porosity": PAPERS_POROSITY}


def usual_beds(cases: pd.DataFrame) -> pd.DataFrame:
    """Select the settled beds that are no wider than a crystallizer's product."""
    return cases[(cases["kind"] == BED) & (cases["ratio"] <= MSMPR_RATIO)]


SETS: Final[dict[str, Callable[[pd.DataFrame], pd.DataFrame]]] = {
    "beds": mixed_beds,
    "beds of a ratio up to 1.5": usual_beds,
    "beds and hard spheres": mixed,
}


def fit_table(cases: pd.DataFrame) -> pd.DataFrame:
    """Tabulate all fits and constants: ``FIT_COLUMNS``."""
    rows = []
    for name, choose in SETS.items():
        chosen = choose(cases)
        for label, exponent in (("free", None), ("eps^3", 3.0)):
            found = fit(chosen, exponent=exponent)
            values = [
                ("exponent of porosity", found.exponent, found.exponent_ci95),
                (f"A at porosity {REFERENCE_POROSITY:g}", found.constant, found.constant_ci95),
                ("exponent of ratio", found.width, found.width_ci95),
                ("scatter between cases", found.scatter, math.nan),
            ]
            rows += [(name, label, *value, found.cases) for value in values]
        for label, column in (("one constant, Sauter mean", "constant"), ("one constant, eq. 3", "eq3")):
            one = overall(chosen, column)
            rows.append((name, label, "A", one.value, one.ci95, one.cases))
            rows.append((name, label, "sd", one.sd, math.nan, one.cases))
    return pd.DataFrame(rows, columns=list(FIT_COLUMNS))
