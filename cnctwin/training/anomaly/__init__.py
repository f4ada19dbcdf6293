"""`cnctwin train anomaly`: from recordings of the machines of a cell to a model and a threshold for each of them."""
