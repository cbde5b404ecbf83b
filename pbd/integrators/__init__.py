"""One file an integrator: a NamedTuple whose step() is one sub-step of the algorithm."""
