"""Links that carry bytes or datagrams, chosen by URI."""
