"""The ICRA 2005 paper's tables and figures, reproduced item by item."""
