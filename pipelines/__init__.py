"""Shipped pipelines; in `scenes/` shipped scenes, and what scenes consist of: shapes, environments, mesh formats."""
