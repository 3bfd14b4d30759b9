"""Acoustic tags of animals: which detections to doubt, and where a tag that rests may be."""
