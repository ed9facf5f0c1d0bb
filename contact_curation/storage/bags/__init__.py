"""Recordings in and out: MCAP, sqlite3 and ROS 1 bags, whole or damaged."""
