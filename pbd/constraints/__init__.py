"""One file a constraint: a NamedTuple of arrays with evaluate(), and a builder that validates."""
