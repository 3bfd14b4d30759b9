"""Robots, their vehicles, waters, channels and deployments."""
