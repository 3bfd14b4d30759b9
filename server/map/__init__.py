"""Field maps: grown, smoothed, learned, compared, exported."""
