# Two commands set everything up: `make demo` (a recording in, a video out) and `make test`. `make` alone lists the rest.
PYTHON ?= python3
VENV := .venv
PIP := $(VENV)/bin/python -m pip --quiet --disable-pip-version-check --no-input
SAMPLE = $$($(VENV)/bin/python -c 'import evimo.samples; print(evimo.samples.path())')
ARGS ?=

.NOTPARALLEL:
.PHONY: help demo test check bench fuzz

help:
	@echo "make demo    install what running needs and run the packaged recording; leaves out/demo"
	@echo "make test    install what development needs and run the tests (ARGS='tests/events -x' narrows them)"
	@echo "make check   format, lint, types, import direction"
	@echo "make bench   speed of every stage; leaves out/bench.json"
	@echo "make fuzz    a hundred thousand damaged files for every reader (ARGS='--files 1000')"

demo: $(VENV)/.base
	@$(VENV)/bin/evimo run "$(SAMPLE)" --out out/demo
	@echo "Now look at $(CURDIR)/out/demo/video.mp4"
	@echo "The tables and maps beside it are explained in README.md under 'What comes out'."

test: $(VENV)/.dev
	@$(VENV)/bin/python -m pytest -n auto --maxprocesses 4 --dist loadfile $(ARGS)

check: $(VENV)/.dev
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/ruff check .
	$(VENV)/bin/python -m pyright
	$(VENV)/bin/python -m pytest tests/test_imports.py

bench: $(VENV)/.dev
	@$(VENV)/bin/python bench/speed.py $(ARGS)

fuzz: $(VENV)/.dev
	@$(VENV)/bin/python bench/fuzz.py $(ARGS)

# ---- the environment: a stamp per stage, renewed when what it was made from changes -----------------------------

# $(error) rather than a failing command: the user reads one line. -c "import ensurepip": Debian ships venv without it.
found = $(shell command -v $(PYTHON))
new_enough = $(shell $(PYTHON) -c 'import sys; print("yes" if sys.version_info >= (3, 11) else "")')
has_venv = $(shell $(PYTHON) -c 'import venv, ensurepip; print("yes")' 2>/dev/null)
define require_python
$(if $(found),,$(error $(PYTHON) is missing: sudo apt install $(notdir $(PYTHON))))
$(if $(new_enough),,$(error $(shell $(PYTHON) --version) is too old: evimo needs Python 3.11 or newer; name it, as in: make demo PYTHON=python3.12))
$(if $(has_venv),,$(error the venv module of $(PYTHON) is missing: sudo apt install $(notdir $(PYTHON))-venv))
endef

$(VENV)/.made:
	$(require_python)
	@echo "making $(VENV)"
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.base: $(VENV)/.made pyproject.toml constraints.txt
	@echo "installing evimo and what running needs (no torch) into $(VENV): about a minute"
	@$(PIP) install --no-compile -c constraints.txt -e .
	@touch $@

$(VENV)/.dev: $(VENV)/.made pyproject.toml constraints.txt
	@echo "installing what development needs (torch, test tools) into $(VENV): two to three minutes"
	@$(PIP) install -c constraints.txt -e '.[dev]'
	@touch $(VENV)/.base $@
