"""What a record gives to an analysis: signals at one rate and band, and a test part that no analysis sees."""
