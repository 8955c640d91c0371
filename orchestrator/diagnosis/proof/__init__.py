"""The proof: free runs on held-out data, the corrected FMU, a second record."""
