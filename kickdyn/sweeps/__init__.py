"""Many postures at once: which one strikes best, and why."""
