"""One file a study, which is one subcommand: run(scene, ...) -> Study; its docstring's first line is its help."""
