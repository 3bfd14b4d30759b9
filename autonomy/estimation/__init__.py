"""Filters that tell where the robot is, and how well it knows."""
