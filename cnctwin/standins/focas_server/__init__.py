"""A FANUC control's FOCAS Ethernet server for a simulated control: to develop against without a machine, and to test the edge."""
