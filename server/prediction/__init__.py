"""Where a robot that is not heard should be, what it will do by itself, and what that was worth."""
