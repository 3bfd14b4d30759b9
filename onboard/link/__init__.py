"""The robot's end of radio links."""
