"""One file a scene: its question, its parameters, and build(parameters) -> Scene."""
