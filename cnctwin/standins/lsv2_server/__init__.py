"""A HEIDENHAIN control on LSV2 without a machine: the simulated control as iTNC 530 or TNC 640."""
