"""Readable forms that the quick ones are held against."""
