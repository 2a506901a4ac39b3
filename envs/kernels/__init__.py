"""Loops over rows of particles, random numbers and short maths: what everything above is made of."""
