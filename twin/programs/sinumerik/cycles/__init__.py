"""The control's technology cycles: drilling, tapping, boring, patterns of holes, pockets, slots, faces."""
