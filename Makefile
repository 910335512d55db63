# Two commands for a new user: `make demo` and `make test`. A stage whose inputs have not changed does nothing.
SHELL := /bin/sh
CFEM := .venv/bin/cfem
PYTHON := .venv/bin/python
SCENES := $(filter-out surrogates soft-gripper stiff-flop-experiments,$(patsubst pipelines/%/report.yaml,%,$(wildcard pipelines/*/report.yaml)))
export OPENBLAS_NUM_THREADS ?= 1
# Bytecode is kept: the tests start a hundred processes, and each would compile all modules again.
export PYTHONDONTWRITEBYTECODE =

.PHONY: demo test smoke test-slow mutate bench wheel docs notebooks lint audit coverage schemas soft-finger-paper figures discretisation mechanics surrogates clean embedded embedded-stiff-flop soft-gripper stiff-flop stiff-flop-experiments parametric-finger parametric-finger-paper finger-shapes regenerate pages pictures wasm $(SCENES)

# The soft finger through all its stages, three numbers and a page.
demo: .venv/all
	@$(CFEM) demo soft-finger

test: .venv/dev
	$(PYTHON) -m pytest -n auto --dist loadfile -r s

# The smallest robot through every command, and what all results stand on: in a minute.
smoke: .venv/dev
	$(PYTHON) -m pytest -n auto --dist loadfile tests/test_pipeline.py tests/core tests/condensed tests/constraint

test-slow: .venv/dev
	$(PYTHON) -m pytest -m slow

# Bodies as strangers bring them, each from its file to a curve, and the table in docs/zoo.md; kept body by body (an hour).
.PHONY: zoo
zoo: .venv/all
	$(PYTHON) tests/zoo/zoo.py

# Lines of the core changed one at a time: some test notices at least 90 % of 60 changes (an hour on two cores).
mutate: .venv/dev
	$(PYTHON) scripts/mutate.py

# Benchmarks as multiples of one of their run, beside those of the last release.
bench: .venv/dev
	mkdir -p build
	$(PYTHON) -m pytest benchmarks --benchmark-json build/bench.json
	$(PYTHON) scripts/bench.py build/bench.json

# The wheel in fresh environments and an empty folder: with every extra, then the base alone (4 minutes, 2 GB).
wheel: .venv/dev
	$(PYTHON) scripts/check_wheel.py

# The documentation site, build/site/index.html, with a live robot on its front page; any warning is an error.
docs: .venv/dev
	$(CFEM) run pipelines/soft-finger/export-page.yaml
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet

# The notebooks print what the site shows; scripts/notebooks.py stores what they print.
notebooks: .venv/dev
	$(PYTHON) -m pytest -m slow tests/test_notebooks.py

lint: .venv/dev
	.venv/bin/ruff check src tests benchmarks scripts examples
	.venv/bin/ruff format --check src tests benchmarks scripts examples
	.venv/bin/lint-imports
	$(CFEM) schema --check

# Our own code for what is known to be dangerous, and the pinned packages for known holes (asks pypi.org).
audit: .venv/dev
	.venv/bin/bandit -q -r src
	.venv/bin/pip-audit --strict --requirement constraints.txt --no-deps --disable-pip

# Branches that the tests take, subprocesses included: of everything, and of what all results stand on.
CORE := src/cfem/mechanics/*,src/cfem/constraint/*,src/cfem/condensed/*,src/cfem/dataset/*,src/cfem/equilibrium/condensation.py,src/cfem/core/artefact/files.py,src/cfem/core/artefact/manifest.py,src/cfem/core/artefact/verify.py
coverage: .venv/dev
	rm -f .coverage*
	$(PYTHON) -m coverage run -m pytest
	$(PYTHON) -m coverage combine -q
	$(PYTHON) -m coverage report --fail-under=90
	$(PYTHON) -m coverage report --fail-under=95 --include='$(CORE)'

schemas: .venv/all
	$(CFEM) schema

# What is stale of a robot's stages, in order; `cfem run` says why.
$(SCENES): .venv/all
	$(CFEM) run pipelines/$@

# Three of the fingers that press the button, on that finger's mesh.
soft-gripper: .venv/all
	$(CFEM) run pipelines/$@ pipelines/$@/control-friction.yaml pipelines/$@/report-lift.yaml

# Robots of silicone that others built and measured: calibrated, every case predicted by the others, one page.
REALITY := measured-beam measured-tentacle measured-arm
.PHONY: reality
reality: .venv/all
	$(CFEM) run $(foreach robot,$(REALITY),pipelines/$(robot))
	$(PYTHON) scripts/reality.py data/reality $(REALITY)

# One finger of many materials and shapes: models of all, controlled, calibrated and designed by them.
parametric-finger: .venv/all
	$(CFEM) run pipelines/$@ $(foreach spec,control-mechanical control-geometric calibrate-modulus design-one-point \
	  design-task,pipelines/$@/$(spec).yaml)

# A finger of twelve shape parameters and two cables: one model, its front, and what matters; half an hour on one core.
finger-shapes: .venv/all
	$(CFEM) run pipelines/$@

# The paper's pair of networks G and F, compared with the finger's models; ten minutes on one core.
parametric-finger-paper: parametric-finger
	$(CFEM) run pipelines/$</train-mechanical-f.yaml pipelines/$</train-geometric-f.yaml
	for kind in mechanical geometric; do $(PYTHON) benchmarks/designs.py $$kind --losses || exit; done

# The paper's experiments on the trunk (docs/stiff-flop-experiments.md), after `make stiff-flop`; ten minutes.
EXPERIMENT := pipelines/stiff-flop-experiments
PUBLISHED := {regularisation: 1e-8, step: 1 ml}
SOFTER := {scene: ["material.young=135 kPa", "materials.0.material.young=81 kPa"]}
FINER := {scene: ["material.young=165 kPa", "materials.0.material.young=99 kPa"], mesh: ../../data/stiff-flop-experiments/mesh-fine}
BY_FE := {open: {mode: open, model: fe-based}, \
  paper: {mode: closed, model: fe-based, gains: {proportional: 0.01, integral: 0.002}}, \
  tuned: {mode: closed, model: fe-based, gains: {phase_margin: 60 deg}}}
stiff-flop-experiments: .venv/all
	$(CFEM) mesh pipelines/stiff-flop/scene.yaml --set 'mesh.size=1.375 mm' --out data/$@/mesh-fine
	$(CFEM) mesh pipelines/stiff-flop-bbrfem/scene.yaml --set 'mesh.size=3.4375 mm' --out data/$@/mesh-bbrfem-fine
	$(CFEM) run $(EXPERIMENT)/control-*.yaml
	$(CFEM) control $(EXPERIMENT)/control-circle.yaml --out data/$@/circle-published --set 'search=$(PUBLISHED)'
	$(CFEM) control $(EXPERIMENT)/control-points.yaml --out data/$@/points-softer --set 'loop.real=$(SOFTER)'
	$(CFEM) control $(EXPERIMENT)/control-points.yaml --out data/$@/points-finer --set 'loop.real=$(FINER)' \
	  --set 'loop.controllers={tuned: {mode: closed}}'
	$(CFEM) control $(EXPERIMENT)/control-points.yaml --out data/$@/points-5hz --set 'loop.rate=5 Hz' \
	  --set 'loop.settle.at_most=400 s' --set 'loop.controllers=$(BY_FE)' \
	  --set 'trajectories={B: {kind: goals, points: {mm: [[106, 26, 32.5]]}}}'
	$(CFEM) report $(EXPERIMENT)/report.yaml
	$(PYTHON) benchmarks/stiff_flop_experiments.py data/$@
	$(PYTHON) benchmarks/stiff_flop_stability.py --alike
	$(PYTHON) benchmarks/stiff_flop_stability.py --seeds 200
	$(PYTHON) benchmarks/control_process.py models/stiff-flop/spectral-export --ticks

# The comparison with the paper's network (about 15 minutes), and all that the README's table states.
soft-finger-paper: .venv/all
	$(CFEM) run pipelines/soft-finger/report-large.yaml

# The finger's controller in C, compiled and tested here; docs/embedded.md has the rest.
embedded: .venv/all
	$(CFEM) run pipelines/soft-finger/export-c.yaml
	$(MAKE) -C models/soft-finger/embedded/c test measure size

# The trunk's, of both models.
embedded-stiff-flop: stiff-flop
	$(CFEM) run pipelines/$</export-c.yaml pipelines/$</export-c-serial.yaml
	for model in spectral serial; do $(MAKE) -C models/$</$$model-embedded/c test measure size || exit; done

# A page of each robot that any browser opens; `make docs` puts those that are there into the site's gallery.
pages: .venv/all
	$(CFEM) run $(wildcard pipelines/*/export-page*.yaml)

# The pictures of robots in docs/pictures, drawn from their pages; needs Playwright and a Chromium.
pictures: pages
	$(PYTHON) scripts/pictures.py

# The program of the page that `cfem export` writes, compiled again after its C code has changed; the compiler is a wheel of 80 MB.
wasm: .venv/dev
	$(PYTHON) scripts/wasm.py

figures: soft-finger-paper
	$(CFEM) mesh pipelines/soft-finger-tet4/scene.yaml
	$(CFEM) sample pipelines/soft-finger-tet4/sample.yaml --workers 1 --force
	$(CFEM) run pipelines/soft-finger/control-other-robot.yaml
	$(PYTHON) scripts/figures.py measure finger other_robot

# Element, mesh and tolerance against run time, from compressible to nearly incompressible.
discretisation: .venv/all
	$(CFEM) report pipelines/soft-finger/report-discretisation.yaml

# All that the tables of the mechanics state: tours, orders of convergence, stability.
mechanics: .venv/dev discretisation
	$(PYTHON) scripts/figures.py measure discretisation tours convergence stability

# Datasets of the small scenes: remade where stale, compared with tests/gold. CI runs it.
regenerate: .venv/dev
	$(PYTHON) scripts/regenerate.py

# Every kind of model on every robot, and the paper's studies of sampling and of meshes: `make surrogates`.
include pipelines/surrogates/study.mk

# dev holds all that all holds
.venv/all: pyproject.toml constraints.txt scripts/setup.sh
	@[ -e .venv/dev ] && [ .venv/dev -nt pyproject.toml ] || scripts/setup.sh all
	@touch $@

.venv/dev: pyproject.toml constraints.txt scripts/setup.sh
	scripts/setup.sh dev
	@touch $@

# All datasets, models and runs, hardware's included: hours of work, so it asks first.
clean:
	@[ -z "$(wildcard data models)" ] || du -sh $(wildcard data models)
	@if [ "$(FORCE)" = 1 ]; then rm -rf data models && echo "removed"; \
	else echo "nothing is removed; 'make clean FORCE=1' removes the above"; fi
