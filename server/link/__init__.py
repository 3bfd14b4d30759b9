"""The radios, modems and acoustic ranges by which the station reaches robots."""
