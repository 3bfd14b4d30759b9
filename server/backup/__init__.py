"""Backups that can be trusted: made by a schedule, checked, encrypted if asked, and restored."""
