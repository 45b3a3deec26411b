"""Plain NumPy scenes: the model, the readers, generated shapes, and packing for the GPU. No GL, no image decoding.

`load.load` reads a file, `animate.complete` adds what it lacks, `animate.at` moves it, `pack.pack` lays it out.
"""
