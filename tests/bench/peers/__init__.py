"""Other solvers of the same hybrid system, each as a function of game, output times and tolerance."""
