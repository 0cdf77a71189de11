# motorgrad: `make demo` and `make test` set up what they need on first use.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# What is installed beside the library: dev for tests, all for TimSim, TimLab and films, and others (CONTRIBUTING.md).
EXTRAS ?= dev,all
EVERY_EXTRA := dev,all,docs,fmi,myosuite,onnx,peers,ray,slurm
comma := ,
# Files are fetched, checked by hashes.txt, and installed; CHECK=no leaves all of that to pip.
CHECK ?= yes
INSTALL = $(BIN)/python tools/install.py $(if $(filter no,$(CHECK)),--unchecked) $(1)
# The library, TimSim, TimLab and the thesis: installed editable, with tests of their own.
PACKAGES := . apps/timsim apps/timlab thesis
CODE := conftest.py src tests tools apps thesis
STAMP := $(VENV)/.installed-$(subst $(comma),-,$(EXTRAS))
WORKERS ?= 2

# One test process per worker: libraries that would start a thread per core in each are told not to. The processes that
# tests start find the library's modules compiled, as a user's do, also where this is turned off.
QUIET_THREADS := NPROC=1 OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=
# Compilers ask for and return much memory; glibc's allocator keeps it here instead of giving it back, which saves a tenth.
KEPT_MEMORY := MALLOC_TRIM_THRESHOLD_=2000000000 MALLOC_TOP_PAD_=67108864 MALLOC_MMAP_THRESHOLD_=1000000000
PYTEST := $(QUIET_THREADS) $(KEPT_MEMORY) $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help install demo editor test test-motorgrad test-timsim test-timlab test-thesis test-extras test-share test-all lint format release bench bench-check torture docs figures gallery notebooks numbers clean

help:  ## say what there is
	@sed -n 's/^\([a-z-]*\):[^#]*##  *\(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{ printf "%-22s %s\n", $$1, $$2 }'

install: $(STAMP)  ## set up .venv with the tested versions (the other targets do it by themselves)

$(STAMP): $(PACKAGES:%=%/pyproject.toml) constraints.txt hashes.txt tools/install.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "motorgrad needs Python 3.11 or later; say make PYTHON=python3.12, for example"; exit 1; }
	@echo "Setting up $(VENV): some minutes the first time, on a slow line."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(call INSTALL,$(EXTRAS))
	@touch $@

demo: $(STAMP)  ## a body learns to hop: learning curve, behaviour and film, in about two minutes
	@if test -f runs/demo/config.toml; then \
		echo "runs/demo holds a run: it goes on, or is shown again if it is complete. For a new one: rm -r runs/demo"; fi
	@$(BIN)/motorgrad demo

EDITOR := apps/timlab/src/timlab/editor
BUILT := $(EDITOR)/static/index.html
EDITOR_SOURCES := $(shell find $(EDITOR)/frontend -type f -not -path "*/node_modules/*")

$(BUILT): $(STAMP) $(EDITOR_SOURCES)
	$(BIN)/python apps/timlab/tools/build_editor.py

editor: $(BUILT)  ## build the pages of TimLab's editor (the other targets do it by themselves)

test: $(STAMP) $(BUILT)  ## the quick tests of all four packages
	$(PYTEST) -m "not slow"

test-motorgrad: $(STAMP) $(BUILT)  ## the quick tests of the library and of what all packages share
	$(PYTEST) -m "not slow" tests

test-timsim: $(STAMP)  ## the quick tests of TimSim
	$(PYTEST) -m "not slow" apps/timsim/tests

test-timlab: $(STAMP) $(BUILT)  ## the quick tests of TimLab
	$(PYTEST) -m "not slow" apps/timlab/tests

test-thesis: $(STAMP)  ## the quick tests of the thesis' experiments
	$(PYTEST) -m "not slow" thesis/tests

test-extras:  ## install every extra, and run the quick tests that need one, a browser or OpenGL
	@$(MAKE) --no-print-directory EXTRAS=$(EVERY_EXTRA) install editor
	$(PYTEST) -m "needs and not slow"

test-share: $(STAMP) $(BUILT)  ## of the slow tests those of documentation, wheel, pages and units
	$(PYTEST) -m "slow and ci"

test-all: $(STAMP) $(BUILT)  ## all tests
	$(PYTEST)

lint: $(STAMP)  ## style, format and types
	$(BIN)/ruff check $(CODE)
	$(BIN)/ruff format --check $(CODE)
	$(BIN)/pyright

format: $(STAMP)  ## put the format right
	$(BIN)/ruff check --fix $(CODE)
	$(BIN)/ruff format $(CODE)

release: $(STAMP) $(BUILT) bench-check  ## compare speed with the last tag; build wheels and source distributions, and try them on the oldest and the newest Python
	$(BIN)/python -m tools.try_release $(PYTHONS)

bench: $(STAMP)  ## measure the speed table of docs/performance.md, store and draw it (ROWS="hopper-*": these)
	set -f; $(BIN)/python -m tools.speed measure $(ROWS)

bench-check: $(STAMP)  ## the speed of this checkout beside a commit's (BASE=COMMIT, by default the last tag; ROWS)
	set -f; $(BIN)/python -m tools.speed check $(if $(BASE),--base $(BASE)) $(if $(ROWS),-- $(ROWS))

torture: $(STAMP)  ## attack: kills, damaged files, mutated inputs (some minutes; COUNT=10 of each)
	$(BIN)/python -m tools.torture --count $(or $(COUNT),10) --record build/torture.json

docs: $(STAMP)  ## the documentation site, in build/site
	@$(BIN)/python -c 'import mkdocs_jupyter' 2>/dev/null || \
		$(call INSTALL,docs)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open build/site/index.html"

figures: $(STAMP)  ## draw the figures of the documentation again
	$(BIN)/python -m tools.figures

gallery: $(STAMP) $(BUILT)  ## make the films and the pictures of the applications in the documentation again
	$(BIN)/python -m tools.figures --films
	$(BIN)/python -m tools.lab_pictures
	$(BIN)/python -m tools.lab_screenshots
	$(BIN)/python -m tools.timsim_screenshots

numbers: $(STAMP)  ## run what README and the tutorial say was run, and compare the numbers (some minutes)
	$(BIN)/python -m tools.documented_numbers

notebooks: $(STAMP)  ## run the notebooks of the documentation again, in place
	@$(BIN)/python -c 'import nbclient, ipykernel, ipywidgets' 2>/dev/null || \
		$(call INSTALL,docs)
	$(BIN)/python -m tools.notebooks docs/notebooks/*.ipynb

clean:  ## remove caches and built files; runs and .venv stay
	rm -rf build $(PACKAGES:%=%/dist) .pytest_cache .ruff_cache .hypothesis
	find $(CODE) -name __pycache__ -type d -prune -exec rm -rf {} +
