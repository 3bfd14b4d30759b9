"""Filters and controllers written as their equations: the oracles of the compiled ones."""
