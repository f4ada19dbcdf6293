"""The routes of the interface: one file for each group of them."""
