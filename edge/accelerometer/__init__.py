"""A sensor beside the control: blocks of raw acceleration in, vibration out."""
