"""Plain NumPy scenes: the model, the readers, generated shapes, and packing for the GPU. No GL, no image decoding.

`load.load` reads a file, `animate.complete` adds missing parts, `animate.at` animates it, `pack.pack` packs it.
"""
