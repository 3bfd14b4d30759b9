"""Where the target is: the filter bank, and the cloud that judges it."""
