"""Optional parts, each with an extra of its own in `pyproject.toml`, and none that the framework needs.

The viewer, Dask clusters, the optimiser of sweeps, figures, and other renderers to measure against. The framework
imports one where it is asked for by its name, and none of the libraries that these are built on.
"""
