"""Benchmarks against other solvers of the same hybrid system."""
