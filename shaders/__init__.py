"""GLSL of the standard nodes, in the same families; shared includes in `include/`."""
