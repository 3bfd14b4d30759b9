"""What leaves the station of a deployment as science: flags of quality, and files with them."""
