"""Gradient training of a model on tosses."""
