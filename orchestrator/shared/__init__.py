"""What every room uses: result directories on disk, caches, the number of cores."""
