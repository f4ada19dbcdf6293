"""The stand-ins for a control or a machine: agents, servers, the simulated and the reference machine."""
