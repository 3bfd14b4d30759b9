"""A vehicle of another maker: an ArduSub-like submarine that speaks standard MAVLink over UDP."""
