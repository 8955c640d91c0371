"""Master algorithms over a narrow slave protocol; nothing here knows FMI."""
