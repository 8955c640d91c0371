"""Speed of masters on the same FMUs and the same scenario: each in its own process, in turn, as ratios."""
