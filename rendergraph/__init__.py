"""Declarative real-time rendering: one YAML file is a renderer."""

__version__ = "0.1.0"
