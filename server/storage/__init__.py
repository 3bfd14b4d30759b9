"""What is kept and how large it is; what of it is thinned, moved to files or deleted, and when."""
