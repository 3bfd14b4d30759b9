"""The acoustic modem: ranges between the antenna and a robot under water, and mini packets."""
