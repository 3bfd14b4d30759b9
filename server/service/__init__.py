"""What the station does between requests, one module a duty."""
