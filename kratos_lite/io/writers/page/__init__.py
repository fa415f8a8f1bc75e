"""Pages for the browser: one file each that shows results in three dimensions, without a network."""
