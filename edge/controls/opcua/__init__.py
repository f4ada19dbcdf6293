"""OPC UA servers of controls: which node is which signal, the session and its guard, what a delivery means, certificates."""
