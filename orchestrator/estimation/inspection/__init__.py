"""What a record holds, before any fit: channels, excitation, what it would show, and a model file to start from."""
