"""Rotations, poses and convex polytopes; plain NumPy, batched, no units of its own."""
