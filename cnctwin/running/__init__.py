"""What runs until it is stopped: edges by their files; processors, with the courier and the store beside them."""
