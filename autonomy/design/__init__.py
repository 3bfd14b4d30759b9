"""Designs: missions as people draw them, and the legs that they become."""
