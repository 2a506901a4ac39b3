# Every target does its own set-up: the first call makes .venv and installs everything, later calls find it ready.
PYTHON ?= python3
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
ARGS ?=
SPEED_ARGS := --env TagTrack/LeopardShark-v0 --num-worlds 1 64 256 --particles 1000 --threads 1 2

VENV := .venv
RUN := $(VENV)/bin/python
PIP := $(RUN) -m pip --disable-pip-version-check
# On a terminal pip shows what it does; in a pipe only what goes wrong. To write byte code of all files, tests of other people
# included, would take longer than all the rest: Python writes it for what is imported.
INSTALL = quiet=-qq; [ ! -t 1 ] || quiet=; $(PIP) install $$quiet --no-compile --constraint constraints.txt
# Containers often set this. Without byte code each process would parse three thousand files anew, most of them torch's: eight seconds.
unexport PYTHONDONTWRITEBYTECODE
# The folder is part of the stamp's name: an editable install points at it, so a moved or copied folder installs anew.
STAMP := $(VENV)/.ready-$(shell pwd | cksum | cut -d ' ' -f 1)

.PHONY: help setup train test check speed kill fuzz soak docs films release-check interop clean

help:
	@echo 'make train   train a policy and compare it with the paper (make train ARGS="--steps 1e3", to see it run)'
	@echo 'make test    run the tests                               (make test ARGS="-k ping", ARGS="-m slow")'
	@echo 'make check   ruff and mypy'
	@echo 'make speed   steps and particle updates a second beside the readable reference filter'
	@echo 'make interop run a script of each RL library in an environment of its own, and write docs/interop.md (half an hour, 16 GB)'
	@echo 'make kill    end commands at random moments: do they go on? (make kill ARGS=50)'
	@echo 'make fuzz    hand in nonsense of each kind                  (make fuzz ARGS=100000)'
	@echo 'make soak    step all worlds on two threads and on one      (make soak ARGS=3600, seconds)'
	@echo 'make release-check   build a wheel and an sdist, try them in an empty venv, go through the list'
	@echo 'make docs    the site, in docs/html                     (make films: its moving pictures anew)'
	@echo 'make setup   only the set-up: $(VENV), CPU build of torch, this folder as an editable install'
	@echo 'make clean   remove $(VENV), .interop and the caches; runs/ stays'
	@echo 'Variables: PYTHON=$(PYTHON)  TORCH_INDEX=$(TORCH_INDEX)  ARGS="..."'

setup: $(STAMP)

train: $(STAMP)
	@$(RUN) -m tagtrack train $(ARGS)

test: $(STAMP)
	@$(RUN) -m pytest $(ARGS)

check: $(STAMP)
	@status=0; $(RUN) -m ruff check . || status=1; $(RUN) -m mypy || status=1; exit $$status

speed: $(STAMP)
	@$(RUN) -m tagtrack eval speed $(or $(ARGS),$(SPEED_ARGS))

docs: $(STAMP)
	@$(RUN) -m sphinx -W --keep-going -q -b html docs docs/html
	@echo 'written: docs/html/index.html'

films: $(STAMP)
	@$(RUN) docs/films.py $(ARGS)

kill: $(STAMP)
	@$(RUN) -m tests.harness.kill $(ARGS)

fuzz: $(STAMP)
	@$(RUN) -m tests.harness.fuzz $(or $(ARGS),200)

soak: $(STAMP)
	@$(RUN) -m tests.harness.soak $(ARGS)

release-check: $(STAMP)
	@$(RUN) -m tests.harness.release $(ARGS)

interop: $(STAMP)
	@TORCH_INDEX="$(TORCH_INDEX)" $(RUN) examples/interop/matrix.py $(ARGS)

# torch comes first, and alone: its CPU build satisfies what asks for torch later, so nothing pulls a CUDA build.
$(STAMP): pyproject.toml constraints.txt
	@$(PIP) --version >/dev/null 2>&1 || { \
	  command -v "$(PYTHON)" >/dev/null || \
	    { echo 'TagTrack needs Python 3.10 or newer; there is no "$(PYTHON)" here. Name one with PYTHON=...' >&2; exit 1; }; \
	  "$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	    { echo "TagTrack needs Python 3.10 or newer; $(PYTHON) is $$("$(PYTHON)" --version 2>&1). Name another with PYTHON=..." >&2; exit 1; }; \
	  "$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || \
	    { echo '$(PYTHON) cannot make virtual environments. On Debian and Ubuntu: apt install python3-venv' >&2; exit 1; }; \
	  echo 'Making $(VENV) ...'; "$(PYTHON)" -m venv --clear $(VENV); }
	@rm -f $(VENV)/.ready-*
	@# The pip that comes with Python may need twice as long, and say nothing meanwhile; but it will do.
	@$(PIP) install -qq --constraint constraints.txt --retries 0 --timeout 10 --upgrade pip 2>/dev/null || :
	@echo 'Installing torch, the CPU build: some 200 MB, once ...'
	@$(INSTALL) --no-deps --index-url "$(TORCH_INDEX)" --retries 0 --timeout 10 torch 2>/dev/null || { \
	  echo 'No torch from $(TORCH_INDEX) (no network, or no build for this machine): taking it from the default package index.'; \
	  $(INSTALL) torch; }
	@echo 'Installing TagTrack and its other dependencies, some 90 packages ...'
	@$(INSTALL) --editable '.[dev]'
	@echo 'Importing them for the first time ...'
	@$(RUN) -c 'import stable_baselines3, tagtrack.envs.single'
	@touch $@

clean:
	rm -rf $(VENV) .interop build dist docs/html docs/environments *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
