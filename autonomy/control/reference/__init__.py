"""Controllers written as their equations: the oracles of the compiled ones, which fly."""
