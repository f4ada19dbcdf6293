"""The wear of each tool of a machine from the cutting load of its parts: level, slope, parts left, and the drift that all
share.
"""
