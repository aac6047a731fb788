"""From a wished-for flight back to the launch."""
