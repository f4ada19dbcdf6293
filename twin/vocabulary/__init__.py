"""The vocabulary that all packages share: signals, topics, nodes. It imports only the standard library: edges read it too."""
