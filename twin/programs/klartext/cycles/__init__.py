"""The machining cycles and those that change coordinates: a file a family."""
