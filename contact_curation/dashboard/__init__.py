"""What people look at: static figures, the report of a session, and the live dashboard."""
