"""Decisions: what each is made of is kept with what came of it, so that it can be repeated."""
