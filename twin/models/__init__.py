"""The model of several that counts: the champion, and the one before it while it is kept warm."""
