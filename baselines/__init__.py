"""What learned policies must beat: the papers' controllers and simple strategies tuned with care."""
