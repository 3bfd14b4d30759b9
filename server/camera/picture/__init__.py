"""What cameras show: now, with marks, and kept only where a pilot says so."""
