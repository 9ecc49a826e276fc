"""A local page on which a game is tried by hand: mog explore."""
