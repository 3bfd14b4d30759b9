"""Plates with tags, and the calibration board, on paper in true size."""
