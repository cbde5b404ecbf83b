# make report: install and write the report.  make test: install and check.  make test-all: slow tests too.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= build/report

.PHONY: report test test-all check gallery reference bench clean

report: $(VENV)/.installed
	$(BIN)/pbdbench report -o $(OUT)

test: check
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow"

test-all: check
	$(BIN)/pytest -n auto --dist loadfile --no-loadscope-reorder

check: $(VENV)/.tests-installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The README's figures, from the report.
gallery: report
	cp $(OUT)/figures/run-time-against-error-rigid-chains-as-called-from-python.png reports/gallery/work-precision.png
	cp $(OUT)/figures/contacts-errors-against-closed-forms.png reports/gallery/contacts.png
	cp $(OUT)/figures/dam-break.png reports/gallery/dam-break.png
	cp $(OUT)/figures/dam-break-moments.png reports/gallery/dam-break-moments.png

# The dam break's numerical reference, in comparisons/data.
reference: $(VENV)/.installed
	$(BIN)/python -m comparisons.studies.front_reference

bench: $(VENV)/.tests-installed
	$(BIN)/python tests/benchmarks/kernel_floor.py
	$(BIN)/python tests/benchmarks/start_up.py
	$(BIN)/python tests/benchmarks/projections.py
	$(BIN)/python tests/benchmarks/solves.py
	$(BIN)/python tests/benchmarks/second_order.py
	$(BIN)/python tests/benchmarks/collisions.py
	$(BIN)/python tests/benchmarks/fluid.py
	$(BIN)/python tests/benchmarks/splishsplash.py

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and f"Python >= 3.11 is needed, this is {v[0]}.{v[1]}; set PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[peers]'
	@touch $@

$(VENV)/.tests-installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[test,peers]'
	@touch $@ $(VENV)/.installed

clean:
	rm -rf build $(VENV)
