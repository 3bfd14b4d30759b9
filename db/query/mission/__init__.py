"""What is asked of robots: missions, plans, transfers, commands and studies."""
