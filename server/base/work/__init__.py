"""Work under way: how a request that began it is answered, and how others wait for its changes."""
