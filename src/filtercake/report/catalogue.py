"""Pages of a study or calibration in the report: titles, introductions and tables."""

from __future__ import annotations

from dataclasses import dataclass

TABLES, FAILED, PROVENANCE = "Tables", "Failed packings", "Provenance"
"""Parts of a study in the report."""


@dataclass(frozen=True)
class PageSpec:
    """A page's part of the report, its title, and its introduction.

    Attributes
    ----------
    part : str
        Part of the study that it stands under.
    title : str
        Title.
    lead : str
        Introductory prose.
    file : str
        CSV below the study's folder; empty for a page that has none.
    """

    part: str
    title: str
    lead: str = ""
    file: str = ""


INTERVALS = "Intervals are 95 % intervals of the mean over packings from different initial clouds."
PAGES: dict[str, PageSpec] = {
    "summary": PageSpec(
        TABLES,
        "Summary of all points",
        "One row per point: porosity of the bed's interior and specific cake resistance by the study's law with the "
        f"full size distribution, and by two laws beside it. {INTERVALS} The law has one of its own. n counts accepted "
        "packings.",
        "summary.csv",
    ),
    "comparison": PageSpec(
        TABLES,
        "Comparison with published porosities",
        "Published porosities from simulations beside ours by the same count. A published value within three standard "
        "deviations of one packing is no different from ours.",
        "tables/comparison.csv",
    ),
    "table1": PageSpec(
        TABLES,
        "Table 1, dimension of the system",
        "Side of the box that holds the spheres of a packing, for our number of spheres and, where a published value "
        "is for another number, for that.",
        "tables/table1.csv",
    ),
    "table2": PageSpec(
        TABLES,
        "Table 2, size classes in the packing",
        "What each distribution keeps when rare, small or large classes are left out of the packing.",
        "tables/table2.csv",
    ),
    "table3": PageSpec(
        TABLES,
        "Table 3, parameters",
        "Material and settings of the packings. Where a sweep varies a property, this is its base value.",
    ),
    "table4": PageSpec(
        TABLES,
        "Table 4, porosity and resistance at the base material",
        f"Ours beside published simulations and measurements. {INTERVALS}",
        "tables/table4.csv",
    ),
    "cross_check": PageSpec(
        TABLES,
        "Cross-check by another engine",
        "Packings of the same clouds by two engines; the difference is the other's porosity less the study's.",
        "tables/cross_check.csv",
    ),
    "crystallizer": PageSpec(
        TABLES, "Crystallizer", "Its steady state at every residence time.", "tables/crystallizer.csv"
    ),
    "filter": PageSpec(
        TABLES,
        "Drum filter",
        "The filter that each point's slurry needs; low and high are the areas at the ends of the resistance's 95 % "
        "interval over the packings, law low and high at those of the law's own.",
        "tables/filter.csv",
    ),
    "levels": PageSpec(
        TABLES,
        "Packings of the design",
        "Residence times that were packed: porosity by the packings, by the instant estimate beside it; resistance and "
        f"filter area from the packings alone. {INTERVALS}",
        "tables/levels.csv",
    ),
    "search": PageSpec(
        TABLES,
        "Best design at every residence time",
        "Settings, sizes and costs; low and high are the ends of the 95 % interval that follows from what is known of "
        "the porosity.",
        "tables/search.csv",
    ),
    "costs": PageSpec(
        TABLES,
        "Cost correlations side by side",
        "The best filter costed by every correlation of its kind, and the best design by each.",
        "tables/costs.csv",
    ),
    "safety": PageSpec(
        TABLES,
        "Safety",
        "What the filter may be designed for, and what each choice leaves out.",
        "tables/safety.csv",
    ),
    "pareto": PageSpec(
        TABLES,
        "Trade-off of two objectives",
        "Designs that no other one beats in both objectives.",
        "tables/pareto.csv",
    ),
    "parity": PageSpec(
        TABLES,
        "Measured and modelled resistances",
        "Every measurement beside the calibrated model, and beside what the other distributions predict for it.",
        "tables/parity.csv",
    ),
    "predictions": PageSpec(
        TABLES,
        "Predictions",
        "Cakes that were never tested, at the calibrated parameters, with 95 % intervals.",
        "tables/predictions.csv",
    ),
    "fits": PageSpec(TABLES, "Filtration tests", "Resistances fitted to the tests, by both forms.", "tables/fits.csv"),
    "compressibility": PageSpec(
        TABLES, "Compressibility", "Power laws of the resistance over pressure.", "tables/compressibility.csv"
    ),
    "pressures": PageSpec(
        TABLES,
        "Compressibility, measured and packed",
        "Exponents of the resistance over the pressure drop: of the measurements, and of the calibrated packings.",
        "tables/pressures.csv",
    ),
    "failed": PageSpec(FAILED, "Failed packings"),
    "provenance": PageSpec(PROVENANCE, "Provenance"),
}
