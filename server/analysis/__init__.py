"""What people expect to see of a deployment: dives, sections, T-S, statistics."""
