"""Pure algorithms of a gliding robotic fish: no input or output, no clock, no threads, no log."""
