"""Positions from cameras: optics of air, water and glass, tags, poses and calibration."""
