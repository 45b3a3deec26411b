"""Shipped pipelines; shipped scenes in `scenes/`."""
