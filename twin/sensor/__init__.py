"""From what is to what is recorded: sensors, and the clocks that stamp them."""
