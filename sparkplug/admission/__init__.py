"""What a host session lets in: the limits, what is refused and why, and the gate that decides it once for all consumers."""
