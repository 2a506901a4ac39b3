"""What a vehicle believes about a fish: the particle filters."""
