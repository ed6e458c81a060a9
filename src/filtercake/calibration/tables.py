"""What comes out of a calibration: its record, and its tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from filtercake.calibration.fit import Observation, Prediction, cake_of, pooled, predict
from filtercake.calibration.rounds import Cake, Outcome, Settings, measured_cakes, responses_at, shortage_of
from filtercake.crystals.csd import CrystalSizeDistribution
from filtercake.errors import CalibrationError
from filtercake.filtration.drum_filter import DrumFilter, area
from filtercake.filtration.resistance import implied_porosity

SAFETY_FACTOR = 2.0
"""The paper's, on the predicted resistance."""
CURVE_POINTS = 101
PRESSURE_COLUMNS = (
    "csd",
    "lowest_pressure_kPa",
    "highest_pressure_kPa",
    "exponent_measured",
    "exponent_measured_ci95",
    "exponent_modelled",
    "exponent_modelled_low",
    "exponent_modelled_high",
)


def summary(outcome: Outcome, settings: Settings, why: str) -> dict[str, Any]:
    """Return the outcome as plain values, fit for JSON."""
    fit = outcome.fit
    return {
        "parameters": {
            e.parameter.name: {"value": e.value, "low": e.low, "high": e.high, "regions": e.regions}
            for e in fit.estimates
        },
        "beside": settings.beside,
        "fixed": settings.fixed,
        "threshold": fit.threshold,
        "scale_freedom": fit.scale_freedom if math.isfinite(fit.scale_freedom) else None,
        "chi_square": fit.chi_square,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "discrepancy": fit.discrepancy,
        "packed_correlation": outcome.packed_correlation,
        "share_of_packings_in_variance": fit.model_share,
        "implied_porosity": settings.implied_porosity,
        "resistance_law": settings.resistance_law,
        "estimator": settings.estimator,
        "ended": why,
        "findings": [asdict(finding) for finding in outcome.findings],
        "rivals": {
            f"{mu:g}": {
                "chi_square": rival.chi_square,
                settings.first: rival.best[0],
                "low": rival.estimates[0].low,
                "high": rival.estimates[0].high,
            }
            for mu, rival in outcome.rivals.items()
        },
    }


def parity_table(outcome: Outcome, settings: Settings, observations: Sequence[Observation]) -> pd.DataFrame:
    """Tabulate measured against modelled resistances at the calibrated parameters, one row per measurement.

    ``relative_uncertainty`` is as the fit takes it: with the scatter of measurements that contradict each other.
    ``left_out_m_kg`` is the resistance that the other distributions predict for this one; ``left_out_ln_error`` its
    error, in ln(alpha), against the weighted mean of the cake's measurements. ``scatter_freedom`` are the degrees of
    freedom of that scatter; blank where the errors are known. ``pressure_kPa`` is blank where packings know none.
    """
    means = pooled(observations)
    rows = []
    for item in observations:
        response = outcome.responses[item.cake, settings.fixed]
        mean, variance = response(np.array([outcome.fit.best]))
        whole = predict(outcome.fit, response)
        rows.append(
            {
                "measurement": item.name,
                "csd": item.csd,
                "pressure_kPa": math.nan if item.pressure_kPa is None else item.pressure_kPa,
                "measured_m_kg": math.exp(item.ln_resistance),
                "relative_uncertainty": math.hypot(item.standard_error, means[item.cake].scatter),
                "scatter_freedom": freedom if math.isfinite(freedom := means[item.cake].freedom) else math.nan,
                "modelled_m_kg": math.exp(float(mean[0])),
                "modelled_low_m_kg": whole.low,
                "modelled_high_m_kg": whole.high,
                "packings_relative_error": math.sqrt(float(variance[0])),
                "left_out_m_kg": math.exp(means[item.cake].mean + outcome.left_out[item.cake])
                if item.cake in outcome.left_out
                else math.nan,
                "left_out_ln_error": outcome.left_out.get(item.cake, math.nan),
            }
        )
    return pd.DataFrame(rows)


def pressures_table(outcome: Outcome) -> pd.DataFrame:
    """Tabulate how the resistance changes with the pressure drop, as measured and as the calibrated packings do.

    One row per distribution measured at several pressures. The exponents are those of alpha ~ dP^k over the measured
    pressures: measured with the measurements' errors and their spread about the line (see
    :func:`filtercake.filtration.constant_pressure.compressibility`), modelled with the parameters' and the packings'.
    """
    rows = [
        {
            "csd": item.csd,
            "lowest_pressure_kPa": item.lowest,
            "highest_pressure_kPa": item.highest,
            "exponent_measured": item.measured,
            "exponent_measured_ci95": item.measured_ci95,
            "exponent_modelled": item.modelled.value,
            "exponent_modelled_low": item.modelled.low,
            "exponent_modelled_high": item.modelled.high,
        }
        for item in outcome.compressibilities
    ]
    return pd.DataFrame(rows, columns=list(PRESSURE_COLUMNS))


def objective_table(outcome: Outcome, settings: Settings) -> pd.DataFrame:
    """Tabulate the objective: both properties and the deviance; for every fixed value of the second, or over both."""
    parts = []
    if settings.fits_both:
        first, second = np.meshgrid(*outcome.fit.axes, indexing="ij")
        columns = {settings.first: first.ravel(), settings.beside: second.ravel()}
        return pd.DataFrame({**columns, "deviance": outcome.fit.deviance.ravel()})
    for value, fit in outcome.rivals.items():
        parts.append(pd.DataFrame({settings.first: fit.axes[0], settings.beside: value, "deviance": fit.deviance}))
    return pd.concat(parts, ignore_index=True)


def response_table(outcome: Outcome, settings: Settings, observations: Sequence[Observation]) -> pd.DataFrame:
    """Tabulate the smooth models: csd, pressure_kPa, both properties, resistance_m_kg and its relative error."""
    along = settings.parameters[0]
    values = np.linspace(along.low, along.high, CURVE_POINTS)
    cakes = {cake_of(*cake): cake for cake in measured_cakes(observations)}
    parts = []
    for (name, fixed), response in outcome.responses.items():
        at = outcome.fit.best[1] if fixed is None else fixed
        points = values[:, None] if fixed is not None else np.column_stack([values, np.full(values.size, at)])
        mean, variance = response(points)
        csd, pressure = cakes[name]
        parts.append(
            pd.DataFrame(
                {
                    "csd": csd,
                    "pressure_kPa": math.nan if pressure is None else pressure,
                    settings.beside: at,
                    settings.first: values,
                    "resistance_m_kg": np.exp(mean),
                    "relative_error": np.sqrt(variance),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def prediction_table(
    outcome: Outcome,
    settings: Settings,
    simulated: pd.DataFrame,
    csds: Mapping[str, CrystalSizeDistribution],
    drum: DrumFilter | None = None,
    slurry_flow: float = 0.0,
) -> pd.DataFrame:
    """Predict the distributions never tested, with the safety factor of the paper beside the interval's upper end.

    Parameters
    ----------
    outcome, settings : Outcome, Settings
        The calibration.
    simulated : DataFrame
        Packings of the distributions to predict (see :func:`simulate`).
    csds : mapping of str to CrystalSizeDistribution
        The full distributions.
    drum, slurry_flow : DrumFilter or None, float
        Filter whose area is wanted, and the slurry that it must take, m3/s.

    Raises
    ------
    CalibrationError
        If a distribution has not enough packings.
    """
    cakes = settings.predicted_cakes
    responses = responses_at(settings, simulated, cakes, settings.fixed)
    shortage = shortage_of(cakes, responses, simulated, settings, settings.fixed)
    if shortage:
        raise CalibrationError(f"not enough accepted packings for a prediction: {shortage}")
    return pd.DataFrame(
        [
            _prediction_row(
                cake, predict(outcome.fit, responses[cake_of(*cake)]), csds[cake[0]], settings, drum, slurry_flow
            )
            for cake in cakes
        ]
    )


def _prediction_row(
    cake: Cake,
    found: Prediction,
    csd: CrystalSizeDistribution,
    settings: Settings,
    drum: DrumFilter | None,
    slurry_flow: float,
) -> dict[str, Any]:
    ends = (found.resistance, found.low, found.high)
    name, pressure = cake
    row: dict[str, Any] = {"csd": name, "pressure_kPa": math.nan if pressure is None else pressure}
    row.update(zip(("resistance_m_kg", "resistance_low_m_kg", "resistance_high_m_kg"), ends, strict=True))
    # the porosity falls as the resistance rises: its ends change places
    material = (settings.density, settings.sphericity, settings.resistance_law)
    porosities = [implied_porosity(alpha, csd, *material) for alpha in ends]
    row.update(zip(("porosity", "porosity_high", "porosity_low"), porosities, strict=True))
    row["high_over_resistance"] = found.high / found.resistance
    row["resistance_with_safety_factor_m_kg"] = SAFETY_FACTOR * found.resistance
    if drum is not None:
        areas = area(drum, np.array([*ends, SAFETY_FACTOR * found.resistance]), slurry_flow)
        names = ("filter_area_m2", "filter_area_low_m2", "filter_area_high_m2", "filter_area_with_safety_factor_m2")
        row.update(zip(names, (float(value) for value in areas), strict=True))
    return row
