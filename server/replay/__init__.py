"""Replays: what is known of a robot at the moment that a browser's cursor is at."""
