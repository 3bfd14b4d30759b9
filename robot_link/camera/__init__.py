"""Cameras as sources of positions: what their processes see, and how they say it."""
