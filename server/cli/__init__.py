"""The `grace` command line, one module a verb."""
