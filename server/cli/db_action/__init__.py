"""Actions of ``grace db`` that are more than a few lines."""
