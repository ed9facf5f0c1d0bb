"""Throws of the simulated arm that a model learns from: how they are chosen, and how what is learned is judged."""
