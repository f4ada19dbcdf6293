"""Which model of several counts: the champion, and the one before it while it is kept warm."""
