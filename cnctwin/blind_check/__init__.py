"""The blind check: the gap diagnosis on cases of the reference machine whose answers are sealed before it runs."""
