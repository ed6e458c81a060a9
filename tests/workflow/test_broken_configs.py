"""Every broken configuration gets one clear error that names file, key, value and what is allowed; no job starts."""

import pytest

BROKEN = {
    "unknown key": ("packing:\n", "packing:\n  colour: red\n", ["packing.colour", "red", "unknown key", "particles"]),
    "misspelt key": ("  replicates: 2", "  replicats: 2", ["packing.replicats", "did you mean replicates?"]),
    "text number": ("particles: 400", "particles: many", ["packing.particles", "'many'", "must be a number"]),
    "negative size": (
        "size_um: 30",
        "size_um: -30",
        ["csds.bimodal.mixture[0].size_um", "-30", "greater than or equal to 0.001"],
    ),
    "fractions": (
        "size_um: 30, volume_fraction: 0.5",
        "size_um: 30, volume_fraction: 0.3",
        ["csds.bimodal.mixture", "sum to 0.8", "must sum to 1"],
    ),
    "unreadable csv": ("file: tiny.csv", "file: nowhere.csv", ["csds.from_file.file", "nowhere.csv", "cannot be read"]),
    "empty sweep": ("cohesion_kJ_m3: [0, 50]", "cohesion_kJ_m3: []", ["sweeps[1].cohesion_kJ_m3", "at least"]),
    "cohesion": (
        "cohesion_kJ_m3: [0, 50]",
        "cohesion_kJ_m3: [0, 400]",
        ["sweeps[1].cohesion_kJ_m3[1]", "400", "at most 206"],
    ),
    "time step": (
        "packing:\n",
        "packing:\n  time_step_us: 5\n",
        ["packing.time_step_us", "= 5", "below the Rayleigh time step 1.23"],
    ),
    "no such distribution": (
        "csd: [bimodal, from_file]",
        "csd: [bimodul]",
        ["sweeps[0].csd[0]", "did you mean bimodal?"],
    ),
}


def start(checkout, text):
    study = checkout.root / "config/test/broken.yaml"
    study.write_text(text)
    done = checkout.run("--dry-run", study="config/test/broken.yaml")
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("case", BROKEN)
def test_is_one_clear_error(checkout, case):
    old, new, words = BROKEN[case]
    text = (checkout.root / "config/test/tiny.yaml").read_text()
    assert old in text
    status, output = start(checkout, text.replace(old, new))
    assert status != 0
    assert "filtercake cannot start" in output and "config/test/broken.yaml" in output
    assert "Traceback" not in output
    for word in words:
        assert word in output, f"{word!r} not in:\n{output}"


def test_missing_engine(checkout):
    text = (checkout.root / "config/test/tiny.yaml").read_text().replace("packing:\n", "packing:\n  engine: liggghts\n")
    (checkout.root / "config/test/broken.yaml").write_text(text)
    done = checkout.run("--dry-run", study="config/test/broken.yaml", FILTERCAKE_LIGGGHTS="/nowhere/liggghts")
    output = done.stdout + done.stderr
    assert done.returncode != 0
    for word in ("broken.yaml", "packing.engine", "liggghts", "/nowhere/liggghts"):
        assert word in output


def test_all_problems_at_once(checkout):
    text = (checkout.root / "config/test/tiny.yaml").read_text()
    text = text.replace("particles: 400", "particles: many").replace("  replicates: 2", "  replicats: 2")
    _, output = start(checkout, text)
    assert "packing.particles" in output and "packing.replicats" in output


def test_unknown_study_and_key_on_the_command_line(checkout):
    done = checkout.snakemake("--dry-run", "--config", "studies=pmmma")
    assert done.returncode != 0 and "did you mean pmma?" in done.stdout + done.stderr
    done = checkout.snakemake("--dry-run", "--config", "studys=pmma")
    assert done.returncode != 0 and "did you mean studies?" in done.stdout + done.stderr
