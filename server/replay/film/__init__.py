"""Films: a stretch of a replay as a file, in three dimensions or as a series of pictures."""
