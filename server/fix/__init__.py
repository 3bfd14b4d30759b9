"""Fixes by cameras: robots found in what all cameras saw together, kept, and told to the robots."""
