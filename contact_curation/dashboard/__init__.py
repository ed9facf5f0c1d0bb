"""What people look at: static figures."""
