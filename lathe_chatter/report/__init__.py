"""Pictures of runs, charts and maps: readable at a glance, the same colours throughout."""
