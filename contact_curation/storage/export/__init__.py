"""Exports selected tosses for other tools."""
