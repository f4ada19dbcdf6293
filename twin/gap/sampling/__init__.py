"""Recordings of any sample period, on the ticks of the servo loops."""
