"""Poses of a body and of the board from detected AprilTags."""
