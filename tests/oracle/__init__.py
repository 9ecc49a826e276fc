"""Independent oracle of the closed loop: the paper's equations in NumPy, sharing no code with the C++ core.

game reads a TOML game, paper_equations transcribes the paper, closed_loop assembles the equations,
simulate integrates them as a hybrid system, linear_loop and equilibrium give closed-form checks,
make_reference writes the reference trajectories in tests/reference.
"""
