"""Remembered byte layouts of data messages: the quick way from bytes to readings, exact or not taken."""
