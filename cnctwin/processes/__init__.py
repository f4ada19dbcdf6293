"""Processes of our own: children that must not outlive us, brokers and ports, the state they publish, ending in order."""
