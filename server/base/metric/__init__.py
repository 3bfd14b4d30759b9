"""The figures by which a station says how it is."""
