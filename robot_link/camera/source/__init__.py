"""Where pictures come from: webcams, cameras in the network, and files."""
