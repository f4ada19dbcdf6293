"""The effects of formats, section 7: one file each, found by discovery."""
