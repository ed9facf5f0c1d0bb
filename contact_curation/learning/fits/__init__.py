"""Exact fits of a polytope to tosses."""
