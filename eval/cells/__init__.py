"""Work cut into parts that depend on nothing but what they are given, and what runs them: processes here, or a Ray cluster."""
