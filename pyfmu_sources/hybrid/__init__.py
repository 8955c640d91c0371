"""What a hybrid machine is made of, whatever the plant."""
