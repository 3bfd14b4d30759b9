"""Messages to and from robots by satellite gateways."""
