"""A crystallizer with kinetics of the user's own, as far as no packing is needed."""

import pandas as pd
import pytest

STUDY = """
crystallizer:
  kinetics: salt
  kinetics_file: own.yaml
  slurry_concentration_kg_m3: 200
material: {}
sweeps:
  - residence_time_min: [15, 30]
"""
OWN = """
salt:
  nucleation_coefficient: 1.0e+13
  units: "B0 #/(m3 s), MT kg/m3, G m/s"
  slurry_concentration_exponent: 1
  growth_rate_exponent: 1
  shape_factor: 0.5
  density_kg_m3: 2000
  source: made up
"""


def test_its_table_is_made_and_read_by_the_figures(checkout):
    folder = checkout.root / "config/test"
    (folder / "salt.yaml").write_text(STUDY)
    (folder / "own.yaml").write_text(OWN)
    assert checkout.planned(study="config/test/salt.yaml")["crystallizer"] == 1
    done = checkout.run("--", "results/salt/tables/crystallizer.csv", study="config/test/salt.yaml")
    assert done.returncode == 0, done.stderr + done.stdout
    table = pd.read_csv(checkout.root / "results/salt/tables/crystallizer.csv")
    assert table["kinetics"].tolist() == ["salt", "salt"]
    rate = (6 * 0.5 * 2000 * 1e13 * 900.0**4) ** -0.25
    assert table["growth_rate_m_s"].tolist() == pytest.approx([rate, rate / 2])
    assert table["nucleation_rate_1_L_s"].tolist() == pytest.approx(
        [1e13 * 200 * rate * 1e-3, 1e13 * 100 * rate * 1e-3]
    )
    # whatever figure is asked for, the table stands before it
    figure = "results/salt/figures/fig13_growth_nucleation.png"
    (checkout.root / "results/salt/tables/crystallizer.csv").unlink()
    plan = checkout.run("--dry-run", "--quiet", "host", "--", figure, study="config/test/salt.yaml")
    assert plan.returncode == 0 and "crystallizer " in plan.stdout + plan.stderr
