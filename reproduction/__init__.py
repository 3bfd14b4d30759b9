"""The thesis's tables and figures worked out anew, ours beside the printed numbers."""
