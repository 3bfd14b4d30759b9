"""Recorded deployments: read from a file, kept, mapped, written to files again."""
