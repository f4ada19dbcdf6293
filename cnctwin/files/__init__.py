"""Files that a person names: part programs in their encoding, and what is written beside them."""
