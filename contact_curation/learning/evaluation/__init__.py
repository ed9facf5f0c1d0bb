"""Prediction errors of a model on held-out tosses."""
