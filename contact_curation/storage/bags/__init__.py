"""Reads recordings (MCAP, sqlite3 and ROS 1 bags, also damaged ones) and writes MCAP."""
