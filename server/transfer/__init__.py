"""Plans on their way to robots."""
