"""An Iridium Short Burst Data service that does not exist: its network, modems and gateways."""
