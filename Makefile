# What a change must pass: pip install -e ".[dev]" && make check
# What runs on one core goes two at a time; the tests come last, so that pytest's own closing line is the last one.

WORKERS ?= 2

.PHONY: check format lint types imports docs pages pictures test quick clean

check:
	$(MAKE) --jobs=2 --output-sync --no-print-directory lint types imports pages
	$(MAKE) --no-print-directory test

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

# The same without drawing pictures for the reference: that what is shipped draws, the tests find.
pages:
	sphinx-build -q -W --keep-going -D pictures=0 -b html docs docs/_build/pages

# The stored pictures of docs/images, as their list says; all take some minutes. ONLY=ssao: those with that in their names.
pictures:
	python docs/images/draw.py $(ONLY)

test:
	pytest -n $(WORKERS)

quick:
	pytest -n $(WORKERS) -m "not slow"

clean:
	rm -rf build dist docs/_build docs/reference/generated
