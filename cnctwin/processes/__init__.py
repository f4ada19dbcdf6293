"""Processes of our own: children that must not outlive us, the private broker, ending in order."""
