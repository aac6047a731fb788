"""Where the ball goes: its flight through the air, its bounces and its rolling to rest.

Open `fly.py` first; `batch.py` has `fly_many`, the same for thousands of launches at once.
"""
