"""What makes FMUs of equations: variables, slaves and their description."""
