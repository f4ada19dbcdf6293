"""Processes of our own: children that must not outlive us, brokers and ports, the state they publish or keep, ending in order."""
