"""Emulated cameras over the simulated tank: pictures by ray tracing, served as a webcam does."""
