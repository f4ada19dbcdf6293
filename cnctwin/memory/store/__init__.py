"""Memory: what came over the broker, kept as it came, and asked by signal, stretch of time and width of window."""
