"""What a browser shows: the viser scene and the operator app."""
