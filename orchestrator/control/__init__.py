"""Control across the gap: loops of several laws on the same plants, and what is measured of them."""
