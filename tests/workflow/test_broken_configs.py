"""Every broken configuration gets one clear error that names file, key, value and what is allowed; no job starts."""

import pytest
from checkouts import TINY, copy_project

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


@pytest.fixture(scope="module")
def refused(tmp_path_factory):
    """What a start with all of the broken studies says; there is one start, for every study's problems are told."""
    checkout = copy_project(tmp_path_factory.mktemp("broken") / "project")
    good = (checkout.root / TINY).read_text()
    for name, (old, new, _) in BROKEN.items():
        assert old in good
        (checkout.root / path_of(name)).write_text(good.replace(old, new))
    two = good.replace("particles: 400", "particles: many").replace("  replicates: 2", "  replicats: 2")
    (checkout.root / path_of("two at once")).write_text(two)
    done = checkout.run("--dry-run", study=",".join(path_of(name) for name in (*BROKEN, "two at once")))
    assert done.returncode != 0
    return done.stdout + done.stderr


def path_of(name):
    return f"config/test/{name.replace(' ', '_')}.yaml"


def said_of(name, output):
    """The lines about a study, each with what belongs to it."""
    return "\n".join(line for line in output.splitlines() if f"{path_of(name)}: " in line)


def test_nothing_but_clear_errors_is_said(refused):
    assert refused.count("filtercake cannot start") == 1
    assert "Traceback" not in refused and "Building DAG" not in refused


@pytest.mark.parametrize("case", BROKEN)
def test_is_one_clear_error(refused, case):
    said = said_of(case, refused)
    assert said.count("\n") == 0
    for word in BROKEN[case][2]:
        assert word in said, f"{word!r} not in:\n{refused}"


def test_all_problems_of_a_study_at_once(refused):
    said = said_of("two at once", refused)
    assert "packing.particles" in said and "packing.replicats" in said


def test_missing_engine(checkout):
    text = (checkout.root / "config/test/tiny.yaml").read_text().replace("packing:\n", "packing:\n  engine: liggghts\n")
    (checkout.root / "config/test/broken.yaml").write_text(text)
    done = checkout.run("--dry-run", study="config/test/broken.yaml", FILTERCAKE_LIGGGHTS="/nowhere/liggghts")
    output = done.stdout + done.stderr
    assert done.returncode != 0
    for word in ("broken.yaml", "packing.engine", "liggghts", "/nowhere/liggghts"):
        assert word in output


def test_unknown_study_and_key_on_the_command_line(checkout):
    done = checkout.snakemake("--dry-run", "--config", "studies=pmmma")
    assert done.returncode != 0 and "did you mean pmma?" in done.stdout + done.stderr
    done = checkout.snakemake("--dry-run", "--config", "studys=pmma")
    assert done.returncode != 0 and "did you mean studies?" in done.stdout + done.stderr
