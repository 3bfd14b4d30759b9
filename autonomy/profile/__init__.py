"""Dives of a robot of any maker, found in the depths that it told."""
