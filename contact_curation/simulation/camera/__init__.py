"""The simulated camera: rendered images, AprilTags and their detection."""
