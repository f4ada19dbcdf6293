"""The control's clock beside the edge's: offset, drift, and what proves them."""
