"""What robots draw from their batteries, learned from past dives, and how long these last."""
