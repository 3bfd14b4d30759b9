"""Follows a target that is known by its range alone."""
