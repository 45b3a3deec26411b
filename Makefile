# What a change must pass: pip install -e ".[dev]" && make check
# Single-threaded checks run two at a time. The tests come last, so that pytest's summary is the last line.

WORKERS ?= 2

# Mesa keeps compiled shaders here, for all workers and for later runs: compiling them takes most of the tests' time.
export MESA_SHADER_CACHE_DIR ?= $(CURDIR)/.cache/mesa
$(shell mkdir -p $(MESA_SHADER_CACHE_DIR))

# Where this is set, every process that a test starts compiles every Python module again.
unexport PYTHONDONTWRITEBYTECODE

# Shaders compile in two thirds of the time without LLVM's optimisations; `make nightly` has them.
test quick: export GALLIVM_PERF ?= nopt

# With these glibc returns the memory of large blocks when they are freed, which keeps a worker below 1 GB.
test quick nightly: export MALLOC_MMAP_THRESHOLD_ ?= 4194304
test quick nightly: export MALLOC_ARENA_MAX ?= 2

.PHONY: check nightly format lint types imports docs pages pictures proofs gpu-times test quick clean

check:
	$(MAKE) --jobs=2 --output-sync --no-print-directory types pages lint imports
	$(MAKE) --no-print-directory test

format:
	ruff check --fix .
	ruff format .

lint:
	ruff format --check .
	ruff check .

# mypy reads everything; `make nightly` asks pyright as well, which editors use.
types:
	mypy

imports:
	lint-imports

docs:
	sphinx-build -q -W --keep-going -b html docs docs/_build/html

# Read every page and resolve every reference, but render no pictures and write no HTML, which takes two thirds of the time.
pages:
	sphinx-build -q -W --keep-going -D pictures=0 -b dummy docs docs/_build/pages

# Redraw the pictures of docs/images as listed in pictures.yaml; all of them take some minutes. ONLY=ssao selects by name.
pictures:
	python docs/images/draw.py $(ONLY)

# Measure again how near the tests of the nodes come to what they allow, and write docs/proofs.md.
proofs:
	python docs/measure_proofs.py

# Time every shipped pipeline, and write docs/gpu-times.md. For a machine with a GPU.
gpu-times:
	python docs/measure_times.py

test:
	pytest -n $(WORKERS) --dist loadgroup

# The fast tests, while working.
quick:
	pytest -n $(WORKERS) --dist loadgroup -m "not slow"

# What is slow by nature: every pipeline in every mode, long fuzzing, large references, a second driver.
nightly:
	pyright
	sphinx-build -q -W --keep-going -D pictures=0 -b html docs docs/_build/html-nightly
	pytest -n $(WORKERS) --dist loadgroup --nightly

clean:
	rm -rf build dist docs/_build docs/reference/generated .cache
