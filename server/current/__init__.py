"""The current of each water: what dives tell of it, its map, and what its predictions were worth.

It stands above the links and below the maps of fields and the plans, which read it.
"""
