"""Films of tagged robots: seen, located and turned into recordings."""
