"""The station's end of the links."""
