"""The paired loops: the experiment, its runs, the calibrated map from their difference to the gap, the sweep."""
