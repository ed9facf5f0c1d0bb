"""Models and trainings as bytes and back."""
