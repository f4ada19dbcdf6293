"""A simulated control behind a real OPC UA server: as a SINUMERIK shows itself, and as OPC 40501-1 and OPC 40502 want it."""
