"""Fluids: smoothing kernels, the neighbour search, and density as a constraint."""
