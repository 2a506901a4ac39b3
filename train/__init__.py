"""Training runs and their record on disk."""
