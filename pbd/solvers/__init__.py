"""One file a solver: a NamedTuple whose solve() projects the batches."""
