"""Hyperparameters learned from measurements, level by level."""
