"""The filter of every product; a module of its own, so that only the figures that show it follow the tables."""

from __future__ import annotations

import pandas as pd

from filtercake.figures import selection
from filtercake.figures.selection import StudyData
from filtercake.results.filter_design import filter_design
from filtercake.results.resistance_columns import ALWAYS


def filtered(data: StudyData, protocol: str = "") -> pd.DataFrame:
    """Tabulate the filter of every product at the base material (see ``filter_design``), smallest crystallizer first.

    Packings are those of a protocol, the study's own if left out.

    ``medium_share_low`` and ``medium_share_high`` are the medium's shares at the ends of the resistance's interval,
    ``medium_share_<law>`` those by the laws that every table has.
    """
    rows = selection.base_points(data, protocol)
    rows = rows[rows["residence_time_min"].notna()]
    table = filter_design(data.study, data.csds, rows).sort_values("crystallizer_volume_m3", kind="stable")
    # the share is the area of the medium alone over the area needed
    alone = table["medium_share"] * table["filter_area_m2"]
    table["medium_share_low"] = alone / table["filter_area_high_m2"]
    table["medium_share_high"] = alone / table["filter_area_low_m2"]
    for law in ALWAYS:
        table[f"medium_share_{law}"] = alone / table[f"filter_area_{law}_m2"]
    return table.reset_index(drop=True)
