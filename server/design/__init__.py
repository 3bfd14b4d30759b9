"""Designs: missions that people draw, change, try and keep; each version can become a plan."""
