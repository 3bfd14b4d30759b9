"""The 3D view: what it may draw, and the door to it."""
