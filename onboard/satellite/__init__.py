"""The robot's end of satellite links."""
