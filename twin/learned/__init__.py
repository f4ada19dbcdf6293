"""Learned terms: tables that were found in recordings and stand in a machine like an effect."""
