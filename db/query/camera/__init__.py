"""Cameras, the tags that they look for, their calibrations, and where they found robots."""
