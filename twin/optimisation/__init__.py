"""Feed and spindle speed for each line of a part program: the fastest or cheapest that all limits allow."""
