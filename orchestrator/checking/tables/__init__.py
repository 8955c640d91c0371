"""The rules as data, one a line; ``checking.rules`` reads them."""
