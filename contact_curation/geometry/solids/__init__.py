"""Rigid bodies out of files: shapes with their mass properties, hulls of few vertices, meshes, URDF and MJCF."""
