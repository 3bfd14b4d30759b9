"""Calibration: lenses by boards, cameras and level by fixed tags, and whether they still hold."""
