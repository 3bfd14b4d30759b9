"""Where the target is: the filter bank, the joint filter beside it, and who is followed."""
