"""Cameras over the tank: their records, tags and calibrations, and the processes that look."""
