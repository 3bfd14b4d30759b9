"""The log book: entries with their versions, shifts, signed pages, and what holds them together."""
