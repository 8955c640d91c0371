"""Models as an analysis sees them: residuals at parameter values and effects, their noise, a bank of effects."""
