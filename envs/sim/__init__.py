"""The world: vehicle, fish, tags and water."""
