"""The machine's physics: pure functions of numbers. No sockets, no clock, no threads, no global random numbers."""
