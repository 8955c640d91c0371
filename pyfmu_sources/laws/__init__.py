"""The laws of the plants by theme: each function beside the rows that describe its parameters."""
