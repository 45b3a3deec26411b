"""Pipelines against each other: pictures, times, memory; one by one or as the product of axes."""
