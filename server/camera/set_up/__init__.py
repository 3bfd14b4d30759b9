"""Setting cameras up: lens, place and latency, as jobs whose heavy part runs in workers."""
