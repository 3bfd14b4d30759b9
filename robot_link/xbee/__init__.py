"""XBee API frames, without input or output."""
