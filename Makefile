# What a change must pass: pip install -e ".[dev]" && make check
# The quick ones come first; the tests come last, so that pytest's own closing line is the last one.

WORKERS ?= 2

.PHONY: check format lint types imports docs test quick clean

check: lint types imports docs test

format:
	ruff check --fix .
	ruff format .

lint:
	ruff format --check .
	ruff check .

types:
	mypy
	pyright

imports:
	lint-imports

docs:
	sphinx-build -q -W --keep-going -b html docs docs/_build/html

test:
	pytest -n $(WORKERS)

quick:
	pytest -n $(WORKERS) -m "not slow"

clean:
	rm -rf build dist docs/_build docs/reference/generated
