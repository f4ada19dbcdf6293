"""A simulated control over a working day; the servers of FOCAS, OPC UA and LSV2 ask it."""
