"""The files beside a session: its numbers, its aliases, and the lock that says whose they are."""
