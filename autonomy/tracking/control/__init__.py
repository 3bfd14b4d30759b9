"""What the pursuer does about it: pursuit law, barrier, inner loop and walls."""
