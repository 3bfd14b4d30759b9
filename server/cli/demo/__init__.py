"""Parts of the demo: its gateway, and the supervisor of its processes."""
