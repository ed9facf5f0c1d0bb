"""Stores of the nodes: SQLite files that survive a killed process."""
