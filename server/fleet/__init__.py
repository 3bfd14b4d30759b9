"""What is known of each robot right now."""
