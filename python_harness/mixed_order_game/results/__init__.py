"""Results: trajectories as arrays and files, what is measured on them, and figures."""
