"""Alarm rules and their acknowledgement."""
