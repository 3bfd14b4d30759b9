"""The map that grows while a robot flies: rows appended to its factors, or inducing points."""
