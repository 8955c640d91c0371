"""One filter for drivetrains of any number of gaps in a row: kernel, its sizes for each plant, models, innovations."""
