"""Pictures: one kick as a 3-D page, and a sweep as a plot."""
