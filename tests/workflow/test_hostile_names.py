"""Names that a shell, Snakemake or a spreadsheet would obey: an error or a run, nothing outside results."""

import json

import pytest

from filtercake.results.tables import read_table

CANARY = "canary"
HOSTILE_FILES = (
    f"a b;$(touch {CANARY}).csv",
    f'it\'s "q" `touch {CANARY}`.csv',
    "st*r[x]?.csv",
    "..sub/../x.csv",
    "-rf.csv",
    "%s&|<>#~.csv",
    "back\\slash.csv",
    "s3:/x.csv",
)
RESULTS = f"r $(touch {CANARY}) `x` 'y'"


def files_of(checkout):
    return {
        path.relative_to(checkout.root)
        for path in checkout.root.rglob("*")
        if path.is_file() and not {".snakemake", "__pycache__"} & set(path.parts)
    }


def write_study(checkout):
    csds = {}
    for index, name in enumerate(HOSTILE_FILES):
        path = checkout.root / "config/test" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("size_um,volume_fraction\n30,0.5\n50,0.5\n")
        csds[f"c{index}"] = {"file": name, "label": f"; touch {CANARY} | {{study}} <b>&amp;"}
    study = {
        "csds": csds,
        "material": {"density_kg_m3": 1180},
        "packing": {"particles": 60, "engine": "embedded", "replicates": 1},
        "sweeps": [{"csd": list(csds)}],
    }
    (checkout.root / "config/test/hostile.yaml").write_text(json.dumps(study))
    return "config/test/hostile.yaml"


def test_hostile_file_names_and_results_folder_are_planned(checkout):
    study = write_study(checkout)
    before = files_of(checkout)
    done = checkout.snakemake("--dry-run", "--config", f"studies={study}", f"results={RESULTS}")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "packing" in done.stdout
    assert files_of(checkout) == before


@pytest.mark.slow
def test_hostile_file_names_and_results_folder_run(checkout):
    study = write_study(checkout)
    before = files_of(checkout)
    done = checkout.snakemake("--config", f"studies={study}", f"results={RESULTS}", timeout=1200)
    assert done.returncode == 0, done.stderr + done.stdout
    made = files_of(checkout) - before
    assert made and all(path.parts[0] == RESULTS for path in made), made


def test_code_in_the_configuration_is_not_run(checkout):
    (checkout.root / "config/config.yaml").write_text(
        f"__use_yte__: true\nstudies:\n  - ?open('{CANARY}', 'w').close() or 'pmma'\n"
    )
    done = checkout.snakemake("--dry-run")
    output = done.stdout + done.stderr
    assert done.returncode != 0 and "Traceback" not in output
    assert "config/config.yaml: __use_yte__ = True: unknown key" in output
    assert not (checkout.root / CANARY).exists()


@pytest.mark.slow
def test_aliases_that_multiply_are_refused_in_the_configuration(checkout):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)]
    (checkout.root / "config/config.yaml").write_text("\n".join(lines) + "\nstudies: *a9\n")
    done = checkout.snakemake("--dry-run")
    output = done.stdout + done.stderr
    assert done.returncode != 0 and "Traceback" not in output
    assert "aliases (*name) are not allowed here" in output


def write_studies_like_numbers(checkout):
    """Studies and distributions whose names YAML, Snakemake or pandas take for numbers or for nothing."""
    for study, csd in {"2024_05": "01", "007": "NA", "1e5": "nan", "nan": '"null"'}.items():
        sizes = "[{size_um: 30, volume_fraction: 0.5}, {size_um: 50, volume_fraction: 0.5}]"
        settings = "{engine: embedded, particles: 200, replicates: 2}"
        text = f"csds:\n  {csd}: {{mixture: {sizes}}}\nmaterial: {{density_kg_m3: 1180}}\npacking: {settings}\n"
        text += f"sweeps: [{{csd: [{csd}], cohesion_kJ_m3: [0, 50]}}]\n"
        (checkout.root / "config/studies" / f"{study}.yaml").write_text(text)


@pytest.mark.parametrize("study", ["2024_05", "007", "1e5", "nan"])
def test_a_study_with_a_name_like_a_number_is_planned(checkout, study):
    write_studies_like_numbers(checkout)
    target = f"results/{study}/summary.csv"
    done = checkout.snakemake(target, "--dry-run", "--config", f"studies={study}")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "summary" in done.stdout


@pytest.mark.slow
def test_studies_with_names_like_numbers_run(checkout):
    write_studies_like_numbers(checkout)
    (checkout.root / "config/config.yaml").write_text("studies: [2024_05, 007, 1e5, nan]\n")
    done = checkout.snakemake(timeout=3000)
    assert done.returncode == 0, done.stderr + done.stdout
    for study, csd in {"2024_05": "01", "007": "NA", "1e5": "nan", "nan": "null"}.items():
        results = checkout.root / "results" / study
        summary = read_table(results / "summary.csv")
        assert set(summary["study"]) == {study} and set(summary["csd"]) == {csd}
        assert read_table(results / "tables/table1.csv")["label"].tolist() == [csd]
        assert (results / "csd" / f"{csd}.csv").exists() and list((results / "figures").glob("fig10*.png"))
