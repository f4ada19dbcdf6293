"""The kinds of files that recordings come in: one file each, found by discovery, recognised by what is in them."""
