"""Effects that a model may lack, a row each: of our plants, of any FMU, of a log."""
