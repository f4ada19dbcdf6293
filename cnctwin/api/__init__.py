"""The runtime interface: one process that looks at the broker, reads the store beside it, and answers over HTTP."""
