"""What a diagnosis reports: sizes, free runs on test data, the corrected model, words and figures."""
