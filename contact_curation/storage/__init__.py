"""Bags, ContactNets data, toss stores, manifests: everything that comes from and goes to disk."""
