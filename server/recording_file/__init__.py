"""Recordings of any maker as files: identified, read, mapped and checked; pure readers."""
