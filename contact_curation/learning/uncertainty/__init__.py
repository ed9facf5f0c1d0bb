"""Uncertainty of fitted parameters, and its empirical coverage."""
