"""The robot itself: its flight program, its nodes, and its end of the links."""
