"""Numbers that stand in place of a guard's: no event ends a mode, or it takes too much work to tell."""

NO_EVENT, TOO_MUCH = -1, -2
