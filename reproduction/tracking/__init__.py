"""Closed loops of target pursuit from start to end, as the thesis ran them."""
