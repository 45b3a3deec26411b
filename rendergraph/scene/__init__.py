"""Plain NumPy scenes: the model, the readers, generated shapes, and packing for the GPU. No GL, no image decoding."""
