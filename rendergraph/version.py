"""The version of rendergraph."""

__version__ = "0.1.0"
