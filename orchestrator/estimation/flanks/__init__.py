"""The gap from the angles of motor and load alone: which flank the teeth touch is a hidden state of the twist."""
