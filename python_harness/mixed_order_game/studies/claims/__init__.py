"""The paper's claims about a game, each judged in a file of its own."""
