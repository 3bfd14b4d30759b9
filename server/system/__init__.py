"""What the station says of itself: health, events, jobs, settings, the live stream."""
