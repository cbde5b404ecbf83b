"""One file a study, which is one subcommand: SUMMARY and run(scene, ...) -> Study."""
