"""A packing that LIGGGHTS spoils becomes a row with a reason; the sweep and the other packings go on."""

import stat

import pandas as pd
import pytest

from filtercake.packing.engines.liggghts import find_executable

pytestmark = pytest.mark.liggghts

SPOILER = """#!/usr/bin/env python3
# Runs the real LIGGGHTS, then spoils its output in a way that the cohesion in the deck chooses.
import os, re, signal, subprocess, sys
deck = open("packing.in").read()
found = re.search(r"cohesionEnergyDensity peratomtypepair 1 ([0-9.]+)", deck)
kind = float(found[1]) if found else 0.0
if kind == 2.0:
    run = subprocess.Popen([{real!r}, *sys.argv[1:]])
    import time; time.sleep(0.1)
    run.send_signal(signal.SIGTERM)
    sys.exit(run.wait())
status = subprocess.call([{real!r}, *sys.argv[1:]])
lines = open("final.dump").read().splitlines()
if kind == 1.0:
    lines = lines[: len(lines) // 2]
elif kind == 3.0:
    lines[3] = str(int(lines[3]) - 2)
    lines = lines[:-2]
elif kind == 4.0:
    words = lines[-1].split()
    words[2] = "nan"
    lines[-1] = " ".join(words)
elif kind == 5.0:
    lines = []
open("final.dump", "w").write("".join(line + "\\n" for line in lines))
sys.exit(status)
"""

REASONS = {
    1.0: "promises 400 atoms",
    2.0: "LIGGGHTS",
    3.0: "2 of 400 spheres are missing",
    4.0: "not finite",
    5.0: "empty or cut short",
}


def test_spoiled_packings_are_rows_with_reasons(checkout):
    real = find_executable()
    if real is None:
        pytest.skip("LIGGGHTS is not installed")
    spoiler = checkout.root / "spoiler"
    spoiler.write_text(SPOILER.format(real=real))
    spoiler.chmod(spoiler.stat().st_mode | stat.S_IXUSR)
    text = (checkout.root / "config/test/tiny.yaml").read_text()
    text = text.partition("sweeps:")[0].replace("replicates: 2", "replicates: 1\n  engine: liggghts")
    text += "sweeps:\n  - csd: bimodal\n    cohesion_kJ_m3: [1, 2, 3, 4, 5, 50]\n"
    (checkout.root / "config/test/spoiled.yaml").write_text(text)
    table = "results/spoiled/summary.csv"
    done = checkout.run("--", table, study="config/test/spoiled.yaml", FILTERCAKE_LIGGGHTS=str(spoiler))
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    rows = pd.read_csv(checkout.root / "results/spoiled/replicates.csv").set_index("cohesion_kJ_m3")
    assert rows.loc[50.0, "status"] == "ok"
    for cohesion, words in REASONS.items():
        assert rows.loc[cohesion, "status"] == "failed"
        assert words in rows.loc[cohesion, "reason"], rows.loc[cohesion, "reason"]
        assert pd.isna(rows.loc[cohesion, "porosity"])
    summary = pd.read_csv(checkout.root / "results/spoiled/summary.csv").set_index("cohesion_kJ_m3")
    assert (summary.loc[list(REASONS), "n_failed"] == 1).all() and summary.loc[50.0, "n_failed"] == 0
    assert "5 packings failed" in output
