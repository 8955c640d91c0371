"""Statistics that know no plant: whitening, damped least squares, noise levels, normal quantiles."""
