"""What was measured and reported, and what is worked out of it."""
