"""One file an engine adapter; `comparisons.engine` says what it must define."""
